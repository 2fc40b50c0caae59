"""Step metrics against python-control, against closed forms, and on awkward shapes."""

import control
import numpy as np
import pytest

from sdt_drake.control import step_metrics

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
    assert metrics.steady_state_error == pytest.approx(np.exp(-10))
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
    assert metrics.steady_state_error == pytest.approx(y_final - y[-1])


@pytest.mark.parametrize(
    ("reaches", "rise_is_nan"), [(0.05, True), (0.5, True), (0.899, True), (0.95, False)]
)
def test_nan_where_it_never_gets_there(reaches, rise_is_nan):
    metrics = step_metrics(RAMP_TIME, exponential(RAMP_TIME, reaches), y0=0, y_final=1)
    assert np.isnan(metrics.rise_time) == rise_is_nan
    assert np.isnan(metrics.settling_time)
    assert metrics.overshoot_percent == 0
    assert metrics.steady_state_error == pytest.approx(1 - reaches, abs=1e-4)


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
