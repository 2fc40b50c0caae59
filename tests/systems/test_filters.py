"""Filters of single signals: python-control's transfer functions, and Tustin's rule."""

import control
import numpy as np
import pytest

from sdt_drake.systems.filters import PASS, filter_of, low_pass, notch, set_filter

S = control.tf("s")


def second_order(omega, a, b, damping):
    return (a * S**2 + b * omega * S + omega**2) / (S**2 + 2 * damping * omega * S + omega**2)


CASES = {
    "first order": (low_pass(50.0, order=1), 50 / (S + 50)),
    "second order": (low_pass(50.0), second_order(50, 0, 0, 0.5**0.5)),
    "critical": (low_pass(50.0, damping=1.0), second_order(50, 0, 0, 1.0)),
    "notch": (notch(80.0, depth=0.1, width=0.5), second_order(80, 1, 0.05, 0.25)),
    "none": (PASS, control.tf(1, 1)),
}
OMEGA = np.geomspace(1, 600, 40)


@pytest.mark.parametrize("period", [None, 0.004])
@pytest.mark.parametrize("name", CASES)
def test_a_filter_has_the_response_of_its_transfer_function(name, period):
    section, G = CASES[name]
    system = filter_of([PASS, section], unit=[1.0, 300.0], period=period)
    found = control.ss(system.A(), system.B(), system.C(), system.D(), period or 0)
    H = np.array([found(np.exp(1j * w * period) if period else 1j * w) for w in OMEGA])
    if period:
        G = control.sample_system(G, period, "bilinear", prewarp_frequency=section.omega)
    expected = np.array([G(np.exp(1j * w * period) if period else 1j * w) for w in OMEGA])
    np.testing.assert_allclose(H[:, 1, 1], expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(H[:, 0, 0], np.ones(len(OMEGA)))
    np.testing.assert_array_equal(H[:, [0, 1], [1, 0]], np.zeros((len(OMEGA), 2)))


@pytest.mark.parametrize("period", [None, 0.004])
def test_a_filter_starts_in_the_steady_state_of_its_signal(period):
    system = filter_of([low_pass(9.0, order=1), PASS, notch(80.0, depth=0.0, width=1.0)],
                       unit=100.0, period=period)  # fmt: skip
    context = system.CreateDefaultContext()
    signal = np.array([2.0, -3.0, 700.0])
    system.get_input_port().FixValue(context, signal)
    set_filter(system, context, signal)
    np.testing.assert_allclose(system.get_output_port().Eval(context), signal, rtol=1e-12)
    if period is None:
        rates = system.EvalTimeDerivatives(context).CopyToVector()
        np.testing.assert_allclose(rates, 0, atol=1e-9)


def test_a_command_filter_limits_the_jerk_of_a_step_of_acceleration():
    """For v_ref = a t the jerk is a omega² t exp(-omega t), at most a omega / e."""
    omega, a = 2 * np.pi * 8, 3.0
    time = np.linspace(0, 1, 20001)
    system = filter_of([low_pass(omega, damping=1.0)])
    model = control.ss(system.A(), system.B(), system.C(), system.D())
    _, jerk = control.impulse_response(model, time)  # of acceleration, as jerk of a step
    assert a * jerk.max() == pytest.approx(a * omega / np.e, rel=1e-6)
