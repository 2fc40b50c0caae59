"""Motions from CSV: what comes in, what is lost, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from motions import PERIOD, SHORT, sampled
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import write_table
from sdt_drake.motion import Motion, import_motion, load_plan, trajectory


def swing(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles and speeds of two joints that swing up and down, from rest to rest in 4 s."""
    w = np.pi / 2
    q = np.stack([1 - np.cos(w * time), 0.3 * (1 - np.cos(2 * w * time))], axis=1)
    v = np.stack([w * np.sin(w * time), 0.6 * w * np.sin(2 * w * time)], axis=1)
    return q, v


def uneven(seed: int = 3) -> np.ndarray:
    """Times from 0 to 4 s, in steps of 1 to 13 ms."""
    steps = np.random.default_rng(seed).uniform(0.001, 0.013, 2000)
    time = np.concatenate([[0.0], np.cumsum(steps)])
    return np.append(time[time < 3.999], 4.0)


@pytest.fixture
def write(tmp_path):
    def write(time, **columns):
        path = tmp_path / "in.csv"
        write_table(path, np.asarray(time, dtype=float), columns)
        return path

    return write


@pytest.mark.parametrize("given", ["v_ref", "q_ref", "both"])
@pytest.mark.parametrize(
    "time", [0.001 * np.arange(4001), 0.02 * np.arange(201), uneven()], ids=["1ms", "20ms", "any"]
)
def test_any_sample_period_becomes_the_interpolation_period(write, time, given):
    q, v = swing(time)
    columns = {"both": {"q_ref": q, "v_ref": v, "tau": v}, "v_ref": {"v_ref": v}}
    motion, loss = import_motion(write(time, **columns.get(given, {"q_ref": q})), PERIOD)
    assert (motion.period, motion.duration) == (PERIOD, 4.0)
    right_q, right_v = swing(motion.time)
    np.testing.assert_allclose(motion.v, right_v, atol=2e-3)
    np.testing.assert_allclose(motion.q, right_q, atol=1e-3)
    # The loss is what anybody would measure at the samples of the file.
    given_v = np.stack([np.interp(time, motion.time, x) for x in motion.v.T], axis=1)
    if given != "q_ref":
        off = np.abs(given_v - v)
        np.testing.assert_allclose(loss.speed, off.max(axis=0), rtol=1e-9)
        np.testing.assert_allclose(loss.speed_time, time[off.argmax(axis=0)])
    assert np.all(loss.position < 1e-3) and loss.position_time.shape == (2,)


def test_a_motion_of_to_csv_is_taken_as_it_is(tmp_path):
    time = PERIOD * np.arange(801)
    q, v = swing(time)
    motion = Motion.from_speeds(PERIOD, q[0], v)
    motion.to_csv(tmp_path / "m.csv")
    same, loss = import_motion(tmp_path / "m.csv", PERIOD)
    assert loss is None
    for name in ("q", "v", "vd"):
        np.testing.assert_array_equal(getattr(same, name), getattr(motion, name))
    other, loss = import_motion(tmp_path / "m.csv", 0.01)
    assert (other.period, len(other.time)) == (0.01, 401)
    assert 0 < loss.speed.max() < 0.01


def test_time_may_start_anywhere_and_the_end_is_rounded_up(write):
    time = 7.25 + 0.007 * np.arange(101)
    motion, _ = import_motion(write(time, v_ref=np.ones((101, 1))), PERIOD)
    assert motion.duration == pytest.approx(0.7)
    motion, _ = import_motion(write(time[:-1], v_ref=np.ones((100, 1))), PERIOD)
    assert motion.duration == pytest.approx(0.695)
    np.testing.assert_allclose(motion.v, 1)


def test_positions_alone_do_not_drift(write):
    time = 0.001 * np.arange(20001)
    q = np.stack([np.sin(time) ** 2, np.cos(3 * time)], axis=1)
    motion, loss = import_motion(write(time, q_ref=q), PERIOD)
    assert loss.position.max() < 9.0 * PERIOD**2 / 4 * 1.6  # a h² / 4, and a h² / 8 between samples
    assert motion.duration == 20


def test_a_coarse_period_that_loses_a_swing_is_refused_with_joint_and_time(write):
    time = 0.001 * np.arange(2001)
    v = np.stack([np.sin(2 * np.pi * time), np.sin(2 * np.pi * 24 * time)], axis=1)
    with pytest.raises(
        InputError,
        match=r"in\.csv: resampled at 0\.005 s joint 2 loses 0\.\d+ rad/s of speed at .* s, "
        r"allowed are 0\.021 rad/s",
    ):
        import_motion(write(time, v_ref=v), PERIOD)


@pytest.mark.parametrize(
    "text, message",
    [
        ("time,v_ref_1\n0,0\n0.2,1\n0.2,0\n", "line 4: time goes from 0.2 to 0.2 s, expected a gr"),
        ("time,v_1\n0,0\n0.1,0\n", "neither v_ref_1 nor q_ref_1"),
        ("time,v_ref_1,q_ref_1,q_ref_2\n0,0,0,0\n1,0,0,0\n", "2 column.s. q_ref_k and 1 v_ref_k"),
        ("time,v_ref_1\n0,0\n1e9,0\n", "expected at least a 1000000th of"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=rf"bad\.csv.*{message}") as error:
        import_motion(path, PERIOD)
    assert "\n" not in str(error.value)


# --- load_plan -------------------------------------------------------------------------------


@pytest.mark.parametrize("planner", ["limiter", "retiming"])
def test_a_csv_at_another_period_is_planned(robot, write, planner):
    time = 0.0125 * np.arange(321)
    path = write(time, v_ref=SHORT.speeds(time))
    plan = load_plan(path, robot, period=PERIOD, planner=planner)
    np.testing.assert_allclose(plan.motion.v, SHORT.speeds(plan.motion.time), atol=0.02)
    assert plan.loss is not None and plan.loss.speed.max() < 0.02
    with pytest.raises(InputError, match=r"in\.csv: .*joint 2"):
        load_plan(path, robot, period=PERIOD, torque_margin=0.1, planner=planner)


def test_a_motion_that_the_limiter_only_checks_is_retimed_by_the_other(robot, tmp_path):
    path = tmp_path / "m.csv"
    sampled(SHORT).to_csv(path)
    margin = 0.9 * load_plan(path, robot, period=PERIOD).peak_use(robot).max()
    with pytest.raises(InputError, match=r"m\.csv: joint \d .* at .* needs torque"):
        load_plan(path, robot, period=PERIOD, torque_margin=margin)
    plan = load_plan(path, robot, period=PERIOD, torque_margin=margin, planner="retiming")
    assert plan.longer > 0 and plan.loss is None
    with pytest.raises(InputError, match="planner: 'fast', expected one of limiter, retiming"):
        load_plan(path, robot, period=PERIOD, planner="fast")


def test_a_spline_in_blocks_is_the_spline_of_all(monkeypatch):
    """Blocks keep memory small; where they meet, the samples beyond have no say."""
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.05, 1.0, 700))
    values = rng.normal(size=(700, 2))
    at = np.sort(np.append(rng.uniform(time[0], time[-1], 3000), time[[0, 100, 200, -1]]))
    whole = [trajectory.splined(at, time, values, order) for order in (0, 1)]
    course = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(time, values.T)
    np.testing.assert_allclose(whole[0], course.vector_values(at).T, rtol=0, atol=1e-12)
    monkeypatch.setattr(trajectory, "_BLOCK", 100)
    for order in (0, 1):
        parts = trajectory.splined(at, time, values, order)
        np.testing.assert_allclose(parts, whole[order], rtol=0, atol=1e-10)
