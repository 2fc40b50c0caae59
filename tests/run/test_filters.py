"""Filters in the loop: start, samples, linear models, a notch at an elastic joint, bad values."""

import numpy as np
import pytest

from sdt_drake.analysis.linear import linear_feedback, operating_point
from sdt_drake.analysis.stability import stability_sweep
from sdt_drake.io.errors import InputError
from sdt_drake.run.simulate import simulate

ALL = {
    "controller.filters.notch_frequency": [9.0, 0.0, 12.0, 12.0],
    "controller.filters.torque_low_pass": [60.0, 60.0, 0.0, 60.0],
    "controller.filters.speed_low_pass": [80.0] * 4,
    "controller.filters.reference_low_pass": [40.0] * 4,
}


@pytest.mark.parametrize("period", [None, 0.001])
@pytest.mark.parametrize("kind", ["pi", "p_pi", "pi_scheduled"])
def test_a_filtered_loop_starts_at_rest_and_stays_there(designed, kind, period):
    fields = ALL | {"controller.kind": kind, "drive.period": period}
    design = designed("coupled_pi", fields, end=0.1, rest=20)
    still = np.tile(design.reference.planned.q[0], (21, 1))
    run = simulate(design, probes=["tau_fb"])
    np.testing.assert_allclose(run.q[:21], still, atol=1e-9)
    np.testing.assert_allclose(run.tau[:21], run.tau[[0] * 21], rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("period", [None, 0.001])
def test_linear_feedback_contains_the_filters(designed, period):
    """C of PI: notch, low passes and gains, one after the other (joint 1), by Tustin's rule."""
    drive = {"drive.period": period}
    plain, filtered = (designed("axis_pi", x | drive, end=0.1) for x in ({}, ALL))
    omega = np.geomspace(1, 300, 20)
    points = ((x, 0, operating_point(x, 0, at_rest=True)) for x in (filtered, plain))
    H, G = (linear_feedback(*point).response(omega) for point in points)
    w, a, b, c = 2 * np.pi * np.array([9.0, 60.0, 80.0, 40.0])

    def s(exact):
        """The s of a filter that is exact at one frequency, over that frequency."""
        if period is None:
            return 1j * omega / exact
        return 1j * np.tan(omega * period / 2) / np.tan(exact * period / 2)

    torque = (s(w) ** 2 + 0.1 * s(w) + 1) / (s(w) ** 2 + s(w) + 1)
    torque /= s(a) ** 2 + 2**0.5 * s(a) + 1
    measured, reference = 1 / (s(b) + 1), 1 / (s(c) + 1) ** 2
    np.testing.assert_allclose(H[:, 0, 16], torque * measured * G[:, 0, 16], rtol=1e-7)
    np.testing.assert_allclose(H[:, 0, 4], torque * reference * G[:, 0, 4], rtol=1e-7)


def test_a_notch_where_motor_and_link_swing_makes_encoders_on_links_stable_at_any_gain(designed):
    """As the findings say; at the locked-rotor frequency a notch hardly helps."""
    design, omega_r = designed("axis_pi"), 65.991
    free = omega_r * np.sqrt(design.i_eff / design.nominal.motor_inertia) / (2 * np.pi)
    np.testing.assert_allclose(free[:2], [60.33, 79.05], atol=0.01)

    def unstable_from(frequency):
        changes = {"controller.filters.notch_frequency": frequency}
        filtered = design.variant(design.scenario.changed(changes))
        sweep = stability_sweep(filtered, omega_r, encoder="link", ratios=np.arange(0.1, 1.6, 0.1))
        return sweep.unstable_from[:2].round(2).tolist()

    assert unstable_from([0.0] * 4) == [0.35, 0.59]
    assert unstable_from([omega_r / (2 * np.pi)] * 4) == [0.37, 0.61]
    assert unstable_from(free) == [np.inf, np.inf]


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"notch_frequency": [9.0]}, r"controller\.filters\.notch_frequency: 1 value\(s\)"),
        ({"notch_frequency": [-1.0] * 4}, r"notch_frequency\[1\]: -1.*, expected .* >= 0"),
        ({"notch_frequency": [9.0] * 4, "notch_depth": [1.0] * 4}, r"notch_depth\[1\]: 1"),
        ({"torque_order": "third"}, r"torque_order: 'third', expected one of first, second"),
        ({"torque_low_pass": [600.0] * 4}, r"600 Hz, expected less than half the rate .*500 Hz"),
    ],
)
def test_a_bad_filter_is_a_line_with_field_and_limit(designed, fields, said):
    changes = {f"controller.filters.{name}": value for name, value in fields.items()}
    with pytest.raises(InputError, match=said):
        designed("axis_pi", changes | {"drive.period": 0.001}, end=0.1)
