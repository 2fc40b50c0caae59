"""Gains against Table 1 and the roots of Eq. 5; step metrics against python-control."""

import control
import numpy as np
import pytest

from sdt_drake.analysis.step import step_metrics
from sdt_drake.io.errors import InputError
from sdt_drake.systems.gains import (
    SpeedGains,
    damping_ratio,
    natural_frequency,
    oscillation_frequency,
    tune,
)

OMEGA_R = 65.991  # rad/s = 10.5028 Hz
I_EFF_MAX = np.array([4.26, 98.01, 796.3, 250.28])  # kg m², Table 1
ZETA = np.array([0.95, 0.98, 0.99, 0.95])
VARIATION = np.array([39.95, 31.82, 7.29, 25.4])  # %
# As printed; K_IS of joint 4 is printed as 2.73e5, but 0.25 * 65.991² * 250.28 = 2.7248e5.
KP_PRINTED = ("2.671e+02", "6.34e+03", "5.2e+04", "1.57e+04")
KI_PRINTED = ("4.64e+03", "1.07e+05", "8.67e+05", "2.72e+05")


def printed(value, like):
    """`value` with as many digits as the text `like`."""
    return f"{value:.{len(like.partition('e')[0].partition('.')[2])}e}"


@pytest.fixture
def gains():
    return tune(I_EFF_MAX, OMEGA_R, ZETA)


@pytest.mark.parametrize("k", range(4))
def test_gains_of_table_1(gains, k):
    assert printed(gains.kp[k], KP_PRINTED[k]) == KP_PRINTED[k]
    assert printed(gains.ki[k], KI_PRINTED[k]) == KI_PRINTED[k]


def test_natural_frequency_is_half_the_structure_at_the_largest_inertia(gains):
    np.testing.assert_allclose(natural_frequency(gains, I_EFF_MAX), OMEGA_R / 2, rtol=1e-12)
    assert np.all(natural_frequency(gains, 0.9 * I_EFF_MAX) > OMEGA_R / 2)


def test_damping_of_table_1(gains):
    """The paper cuts the last digit of some of them off, hence the tolerance."""
    smallest = I_EFF_MAX * (1 - VARIATION / 100)
    np.testing.assert_allclose(damping_ratio(gains, I_EFF_MAX), ZETA, rtol=1e-12)
    np.testing.assert_allclose(
        damping_ratio(gains, smallest), [1.23, 1.18, 1.03, 1.099], rtol=0, atol=0.01
    )


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95, 1.0, 1.7, 4.0])
def test_damping_and_frequencies_against_the_roots(gains, share):
    i_eff = share * I_EFF_MAX
    for k in range(4):
        roots = np.roots([1, gains.kp[k] / i_eff[k], gains.ki[k] / i_eff[k]])
        omega_n = np.sqrt(np.prod(roots).real)
        assert natural_frequency(gains, i_eff)[k] == pytest.approx(omega_n, rel=1e-9)
        assert damping_ratio(gains, i_eff)[k] == pytest.approx(
            -roots.real.sum() / 2 / omega_n, rel=1e-9
        )
        assert oscillation_frequency(gains, i_eff)[k] == pytest.approx(
            np.abs(roots.imag).max(), rel=1e-7, abs=1e-9
        )


def test_oscillation_frequency_at_0_95_is_0_312_not_0_32():
    gains = tune([4.26], OMEGA_R, [0.95])
    share = oscillation_frequency(gains, [4.26]) / natural_frequency(gains, [4.26])
    np.testing.assert_allclose(share, 0.312, rtol=0, atol=5e-4)


def test_one_damping_for_all_and_gains_by_hand():
    gains = tune([1.0, 4.0], 2.0, 1.0)  # omega_n = 1
    np.testing.assert_allclose(gains.ki, [1, 4])
    np.testing.assert_allclose(gains.kp, [2, 8])
    by_hand = SpeedGains(kp=np.array([6.0]), ki=np.array([9.0]))
    assert natural_frequency(by_hand, [4.0]) == pytest.approx(1.5)
    assert damping_ratio(by_hand, [4.0]) == pytest.approx(0.5)


def test_gains_that_are_no_numbers_are_refused():
    with pytest.raises(InputError, match="too small"):
        tune([1.0], 1e-170, 1.0)
    with pytest.raises(InputError, match="too large"):
        tune([1.0], 1e170, 1.0)


def test_omega_ratio_is_omega_n_over_omega_r():
    for ratio in (0.1, 0.5, 1.3):
        gains = tune(I_EFF_MAX, OMEGA_R, ZETA, ratio)
        np.testing.assert_allclose(natural_frequency(gains, I_EFF_MAX), ratio * OMEGA_R, rtol=1e-12)
        np.testing.assert_allclose(damping_ratio(gains, I_EFF_MAX), ZETA, rtol=1e-12)


# --- step responses -------------------------------------------------------------------------

RAMP_TIME = np.linspace(0, 10, 1001)


def exponential(t, final=1.0):
    return final * (1 - np.exp(-t))


@pytest.mark.parametrize("zero", [False, True], ids=["no zero", "zero"])
@pytest.mark.parametrize("omega", [33.0])
@pytest.mark.parametrize("zeta", [0.1, 0.69, 1.0, 3.0])
def test_agrees_with_python_control(zeta, omega, zero):
    """`control` takes the next sample where we interpolate: they differ by up to one step."""
    denominator = [1, 2 * zeta * omega, omega**2]
    numerator = denominator[1:] if zero else denominator[2:]
    t = np.linspace(0, 60 / omega, 20001)
    _, y = control.step_response(control.tf(numerator, denominator), t)
    expected = control.step_info(y, T=t, yfinal=1.0)
    metrics = step_metrics(t, y, y0=0, y_final=1)
    step = t[1] * 1.001
    assert metrics.rise_time == pytest.approx(expected["RiseTime"], abs=step)
    assert metrics.settling_time == pytest.approx(expected["SettlingTime"], abs=step)
    assert metrics.overshoot_percent == pytest.approx(max(expected["Overshoot"], 0), abs=1e-9)
    assert metrics.peak == pytest.approx(expected["Peak"])
    if metrics.overshoot_percent > 1e-3:  # otherwise the peak is a flat end
        assert metrics.peak_time == pytest.approx(expected["PeakTime"], abs=step)
    assert metrics.steady_state_error == pytest.approx(0, abs=3e-3)


def test_closed_forms_by_interpolation():
    """Times are much better than the step of the samples, 0.01."""
    metrics = step_metrics(RAMP_TIME, exponential(RAMP_TIME), y0=0, y_final=1)
    assert metrics.rise_time == pytest.approx(np.log(9), abs=1e-4)
    assert metrics.settling_time == pytest.approx(np.log(50), abs=1e-4)
    assert metrics.steady_state_error == pytest.approx(-np.exp(-10))
    zeta, omega = 0.4, 3.0
    _, y = control.step_response(control.tf([omega**2], [1, 2 * zeta * omega, omega**2]), RAMP_TIME)
    metrics = step_metrics(RAMP_TIME, y, y0=0, y_final=1)
    damped = np.sqrt(1 - zeta**2)
    assert metrics.overshoot_percent == pytest.approx(
        100 * np.exp(-np.pi * zeta / damped), rel=1e-3
    )
    assert metrics.peak_time == pytest.approx(np.pi / omega / damped, abs=0.01)


@pytest.mark.parametrize("band", [0.01, 0.05, 0.3])
def test_the_band_is_a_share_of_the_step(band):
    t = np.linspace(0, 10, 10001)
    metrics = step_metrics(t, 5 - 2 * exponential(t), y0=5, y_final=3, band=band)
    assert metrics.settling_time == pytest.approx(-np.log(band), abs=1e-5)


@pytest.mark.parametrize(("y0", "y_final"), [(1, 0), (0, -1), (5, 2), (-3, 4), (-1, -6), (2, 1e3)])
def test_direction_start_and_time_of_the_step_do_not_matter(y0, y_final):
    _, response = control.step_response(control.tf([4], [1, 1.2, 4]), RAMP_TIME)
    expected = step_metrics(RAMP_TIME, response, y0=0, y_final=1)
    y = y0 + (y_final - y0) * response
    metrics = step_metrics(RAMP_TIME + 7, y, y0=y0, y_final=y_final)
    for name in ("rise_time", "settling_time", "overshoot_percent", "peak_time"):
        assert getattr(metrics, name) == pytest.approx(getattr(expected, name), rel=1e-9), name
    assert metrics.peak == pytest.approx(y0 + (y_final - y0) * expected.peak)
    assert metrics.steady_state_error == pytest.approx(y[-1] - y_final)


@pytest.mark.parametrize(
    ("reaches", "rise_is_nan"), [(0.05, True), (0.5, True), (0.899, True), (0.95, False)]
)
def test_nan_where_it_never_gets_there(reaches, rise_is_nan):
    metrics = step_metrics(RAMP_TIME, exponential(RAMP_TIME, reaches), y0=0, y_final=1)
    assert np.isnan(metrics.rise_time) == rise_is_nan
    assert np.isnan(metrics.settling_time)
    assert metrics.overshoot_percent == 0
    assert metrics.steady_state_error == pytest.approx(reaches - 1, abs=1e-4)


def test_still_outside_at_the_end_has_not_settled():
    t = np.linspace(0, 10, 1001)
    growing = 1 + 0.001 * np.exp(t / 2) * np.sin(5 * t)
    assert np.isnan(step_metrics(t, growing, y0=0, y_final=1).settling_time)
    leaves_last = np.append(np.ones(1000), 1.021)
    metrics = step_metrics(t, leaves_last, y0=0, y_final=1)
    assert np.isnan(metrics.settling_time)
    assert metrics.overshoot_percent == pytest.approx(2.1)


@pytest.mark.parametrize(
    ("t", "y", "settled"),
    [
        # Leaves the band upwards and comes back at 4.5 + 0.8 / 2.
        ([0, 1, 2, 3, 4, 4.5, 5, 6], [0, 1, 1, 1, 1, 1.1, 1, 1], 4.5 + 0.5 * 0.8),
        # Leaves it downwards, back at 3 + 0.48 / 0.5.
        ([0, 1, 2, 3, 4, 5], [0, 1, 1, 0.5, 1, 1], 3 + 0.96),
        # From above, through the whole band between two samples: last outside at 1.02.
        ([0, 1, 2, 3], [0, 1.5, 0.99, 1], 1 + 0.48 / 0.51),
        # From below, likewise: last outside at 0.98.
        ([0, 1, 2, 3], [0, 0.5, 1.01, 1], 1 + 0.48 / 0.51),
        ([0, 1, 2], [0.99, 1, 1], 0),
    ],
)
def test_settling_is_the_last_exit_on_a_polyline(t, y, settled):
    assert step_metrics(t, y, y0=0, y_final=1).settling_time == pytest.approx(settled, abs=1e-12)


def test_rise_is_between_first_crossings():
    t = [0, 1, 2, 3, 4, 5, 6]
    y = [0, 0.5, 0.05, 0.5, 1.0, 0.5, 1.0]
    metrics = step_metrics(t, y, y0=0, y_final=1)
    assert metrics.rise_time == pytest.approx(3.8 - 0.2)
