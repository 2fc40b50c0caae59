"""Tracking metrics on recordings whose answers are known, and metrics of steps."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers.strategies import GENERATORS
from helpers.variants import recorded
from hypothesis import given, settings
from hypothesis import strategies as st

from sdt_drake.analysis.metrics import METRICS, columns_of, family_of, metric_of, plain_number
from sdt_drake.analysis.step import step_metrics
from sdt_drake.analysis.tracking import constant_speed_segments, motor_use, track
from sdt_drake.motion import LearnedReference, Motion
from sdt_drake.run.simulate import simulate

PERIOD = 0.01


def make_motion(*knots):
    """A motion through knots (time, speed, speed, ...), linear between them, from q = 0."""
    times, *speeds = np.transpose(np.array(knots, dtype=float))
    t = np.arange(round(times[-1] / PERIOD) + 1) * PERIOD
    # Rounded, so that a constant speed is one number.
    v = np.stack([np.round(np.interp(t, times, joint), 9) for joint in speeds], axis=1)
    return Motion.from_speeds(PERIOD, np.zeros(len(speeds)), v)


# Joint 1: rest, ramp, constant for 3 s, ramp, rest. Joint 2 rests. Joint 3 always accelerates.
# Joint 4: constant for 0.9 s only. Joint 5: constant from the first sample to the last.
MOTION = make_motion(
    (0, 0, 0, 0.0, 0, -0.3),
    (1, 0, 0, 0.1, 0, -0.3),
    (2, 0.5, 0, 0.3, 1, -0.3),
    (2.9, 0.5, 0, 0.6, 1, -0.3),
    (5, 0.5, 0, 1.0, 0, -0.3),
    (6, 0, 0, 1.5, 0, -0.3),
)


@settings(max_examples=10)
@given(GENERATORS)
def test_speed_and_position_errors_are_separate(rng):
    off_v, off_q = rng.normal(size=(2, *MOTION.v.shape)) * rng.integers(0, 2, (2, 1, 5))
    tracking = track(recorded(MOTION, v=MOTION.v + off_v, q=MOTION.q + off_q))
    np.testing.assert_allclose(tracking.max_abs_speed_error, np.abs(off_v).max(axis=0))
    rms = np.linalg.norm(off_v, axis=0) / np.sqrt(len(off_v))
    np.testing.assert_allclose(tracking.rms_speed_error, rms)
    np.testing.assert_allclose(tracking.max_abs_position_error, np.abs(off_q).max(axis=0))
    # Joint 1 has constant speed from 2 s on, and decelerates from 5 s on; 1 s is for settling.
    steady = np.abs(off_v[300:500, 0]).max(), np.abs(off_v[101:, 4]).max()
    expected = [steady[0], np.nan, np.nan, np.nan, steady[1]]
    np.testing.assert_allclose(tracking.constant_speed_error, expected)
    assert not tracking.saturated_fraction.any()


def test_speed_is_constant_a_second_after_the_first_sample():
    v = np.stack([np.full(301, -0.3), np.zeros(301), np.arange(301.0)], axis=1)
    found = constant_speed_segments(v, PERIOD)
    np.testing.assert_array_equal(found, (np.arange(301) >= 100)[:, None] * [True, False, False])


def test_metrics_in_percent_and_degrees_have_their_factors():
    factors = {"%": 100, "d": np.degrees(1)}
    for name, metric in METRICS.items():
        assert metric.factor == factors.get(metric.unit[0], 1), name


def test_saturated_fraction_is_a_share_of_time():
    saturated = np.zeros_like(MOTION.v)
    saturated[1:151, 0] = 0.5  # half of a quarter of the periods
    saturated[:, 1] = 1.0
    tracking = track(recorded(MOTION, saturated=saturated))
    np.testing.assert_allclose(tracking.saturated_fraction, [0.125, 1, 0, 0, 0])


# --- head and motors ----------------------------------------------------------------------------


def test_torque_metrics_are_within_periods_and_shares_of_limits():
    """The RMS of the first sample is that of no period; the peak counts."""
    tau, limit = np.zeros_like(MOTION.v), np.array([10.0, 20, 5, 8, 1])
    tau[:, 0], tau[200, 2], tau[0, 3] = 3.0, 5.0, 8.0
    tau[:, 1] = np.abs(12 * np.sin(2 * np.pi * MOTION.time / 6))  # one whole period
    run = recorded(MOTION, tau_peak=tau, tau_rms=0.5 * tau)
    use = motor_use(run, SimpleNamespace(motor_torque_limit=limit))
    np.testing.assert_allclose(use.peak_torque, [3, 12, 5, 8, 0])
    np.testing.assert_allclose(use.rms_torque, [1.5, 6 / np.sqrt(2), 2.5 / np.sqrt(600), 0, 0])
    np.testing.assert_allclose(use.peak_share * limit, use.peak_torque)
    np.testing.assert_allclose(use.rms_share * limit, use.rms_torque)


# --- steps and how numbers are shown ------------------------------------------------------------


@settings(max_examples=15)
@given(st.floats(0.1, 0.8), st.floats(-5, 5), st.floats(0.5, 9), st.booleans())
def test_metrics_of_an_analytic_step_scale_with_its_units(zeta, y0, size, falls):
    """Second order, omega_n = 1: overshoot e^{-pi zeta / sqrt(1 - zeta²)} at pi / omega_d."""
    t = np.linspace(0, 60, 60_001)
    omega_d = np.sqrt(1 - zeta**2)
    unit = 1 - np.exp(-zeta * t) * (np.cos(omega_d * t) + zeta / omega_d * np.sin(omega_d * t))
    size = -size if falls else size
    found = step_metrics(t + 7, y0 + size * unit, y0=y0, y_final=y0 + size)
    assert found.overshoot_percent == pytest.approx(100 * np.exp(-np.pi * zeta / omega_d), abs=1e-3)
    assert found.peak_time == pytest.approx(np.pi / omega_d, abs=1e-3)
    assert found.peak == pytest.approx(y0 + size * (1 + found.overshoot_percent / 100))
    rise = np.interp([0.1, 0.9], unit[: np.argmax(unit)], t[: np.argmax(unit)])
    assert found.rise_time == pytest.approx(np.diff(rise)[0], abs=1e-6)
    last = t[np.flatnonzero(np.abs(unit - 1) > 0.02)[-1]]
    assert found.settling_time == pytest.approx(last, abs=2e-3)
    assert found.steady_state_error == pytest.approx(size * (unit[-1] - 1), abs=1e-12)


def test_unfinished_step_has_no_times():
    found = step_metrics([0, 1, 2], [0, 0.2, 0.5], y0=0, y_final=1)
    assert np.isnan([found.rise_time, found.settling_time]).all()
    assert (found.overshoot_percent, found.steady_state_error) == (0, -0.5)
    at_once = step_metrics([3, 4], [1, 1], y0=0, y_final=1)
    assert (at_once.rise_time, at_once.settling_time) == (0, 0)


def test_metric_columns_are_in_their_headers_unit():
    position, share = np.array([0.1, 0.2]), np.array([0.25, np.nan])
    columns = columns_of({"peak_torque_share": share, "max_abs_position_error": position, "x": 1})
    assert [header for header, *_ in columns] == ["position [deg]", "torque peak [%]"]
    np.testing.assert_allclose(
        [values for *_, values in columns], [np.degrees(position), 100 * share]
    )
    numbers = {4711.2: "4711", 47.112: "47.11", 0.47112: "0.4711", 1e-4: "0.0001", 0: "0"}
    assert {x: plain_number(x) for x in numbers} == numbers and plain_number(4.71e-5) == "4.7e-05"
    assert METRICS["felt_share"].text(0.5) == "50.0" and METRICS["felt_share"].text(None) == "–"


@pytest.mark.parametrize(
    ("name", "family"),
    [("rms_speed_error_12", ("rms_speed_error", 12)), ("stretch", ("stretch", None)),
     ("rms_speed_error_0", ("rms_speed_error_0", None)), ("own_2", ("own_2", None))],
)  # fmt: skip
def test_outcome_names_have_metric_and_joint(name, family):
    assert family_of(name) == family
    assert metric_of(name).title == getattr(METRICS.get(family[0]), "title", name)


def test_errors_are_against_the_planned_motion_after_learning(designed):
    """The second argument of 0.4, the tracked motion, gave NaN for a learned reference."""
    design = designed("axis_pi", end=1.5, rest=100)
    planned = design.reference.planned
    lifted = Motion(planned.period, planned.q, 1.01 * planned.v, planned.vd)
    run = simulate(design.given(LearnedReference(lifted)))
    found = track(run)
    np.testing.assert_array_equal(found.max_abs_speed_error, np.abs(run.v - planned.v).max(axis=0))
    with pytest.warns(DeprecationWarning, match=r"track\(run, motion\) is track\(run\)"):
        again = track(run, lifted)
    np.testing.assert_array_equal(again.rms_speed_error, found.rms_speed_error)
