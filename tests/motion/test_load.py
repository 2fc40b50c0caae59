"""Motions, their files, and what resampling loses."""

import numpy as np
import pytest
from helpers.motions import PERIOD, SWING, sampled
from helpers.strategies import motions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import write_table
from sdt_drake.motion import (
    PLANNERS,
    LearnedReference,
    Motion,
    import_motion,
    load_plan,
)
from sdt_drake.motion.trajectory import resampled

ANY_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


def same(one: Motion, other: Motion) -> None:
    assert one.period == other.period
    for name in ("q", "v", "vd", "time"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@settings(ANY_FILE, max_examples=15)
@given(
    motion=motions(2),
    period=st.sampled_from([0.005, 0.1, 1 / 3, 1 / 300]),
    share=st.floats(0, 0.99),
)
def test_motion_comes_back_from_files_and_trajectory(tmp_path, motion, period, share):
    motion = Motion.from_speeds(period, motion.q[0], motion.v)
    motion.to_csv(tmp_path / "motion.csv")
    same(Motion.from_csv(tmp_path / "motion.csv"), motion)
    same(import_motion(tmp_path / "motion.csv", period)[0], motion)
    LearnedReference(motion, motion.v).to_csv(tmp_path / "learned.csv", motion)
    learned = LearnedReference.from_csv(tmp_path / "learned.csv")
    same(learned.motion, motion)
    np.testing.assert_array_equal([learned.torque, learned.planned], [motion.v, motion.q])
    dt = share * period
    time, q, v, vd = (x[:-1] for x in (motion.time + dt, motion.q, motion.v, motion.vd))
    for order, right in enumerate((q + v * dt + vd * dt**2 / 2, v + vd * dt, vd)):
        values = motion.trajectory.derivative(order).vector_values(time).T
        np.testing.assert_allclose(values, right, atol=1e-12 * 1000**order)


# 0.5 s steps: q = t² / 2 up to 1 s, then constant speed. Further columns are ignored.
CSV = """time,q_ref_1,v_ref_1,vd_ref_1,tau_1
0.0,0,0,1,9
0.5,0.125,0.5,1,8
1.0,0.5,1,0,7
1.5,1.0,1,0,6
"""

BAD = [
    (CSV.replace(",v_ref", ",speed"), ": no column v_ref_1"),
    (CSV.replace("tau_1", "q_ref_2"), "number of joints"),
    (CSV.replace("0.5,0.125", "0.7,0.125"), ", line 4: time goes from"),
    ("time,q_ref_1,v_ref_1,vd_ref_1\n0.5,0,0,0\n1.0,0,0,0\n", ", line 2: time starts at 0.5 s"),
    (CSV.replace("0.5,1,8", "0.5,0.9,8"), ", line 3: vd_ref_1 does not fit v_ref_1: 0.9"),
    (CSV.replace("1.5,1.0", "1.5,1.1"), ", line 5: q_ref_1 does not fit v_ref_1: 1.1"),
    # The last acceleration is held beyond the motion.
    (CSV.replace("1.0,1,0,6", "1.0,1,7,6"), ", line 5: vd_ref_1"),
]


@pytest.mark.parametrize("text, message", BAD, ids=[case[-1] for case in BAD])
def test_bad_motion_csv_is_refused_with_its_line(tmp_path, text, message):
    assert text != CSV
    (tmp_path / "motion.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=f"motion.csv.*{message}"):
        Motion.from_csv(tmp_path / "motion.csv")


def swing(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles and speeds of two joints that swing up and down, from rest to rest in 4 s."""
    size, w = [1, 0.3], np.array([np.pi / 2, np.pi])
    angle = time[:, None] * w
    return size * (1 - np.cos(angle)), size * w * np.sin(angle)


@settings(ANY_FILE, max_examples=8)
@given(
    gaps=st.lists(st.floats(0.001, 0.013), min_size=1, max_size=9),
    start=st.floats(-9, 9),
    names=st.sampled_from([("v_ref",), ("q_ref",), ("q_ref", "v_ref")]),
)
def test_motion_file_is_resampled_to_the_interpolation_period(tmp_path, gaps, start, names):
    time = np.concatenate([[0], np.cumsum(np.resize(gaps, 4000))])
    time = np.append(time[time < 3.999], 4.0)
    columns = dict(zip(("q_ref", "v_ref"), swing(time), strict=True))
    write_table(tmp_path / "in.csv", time + start, {name: columns[name] for name in names})
    motion, loss = import_motion(tmp_path / "in.csv", PERIOD)
    assert motion.period == PERIOD and motion.duration == pytest.approx(4.0)
    np.testing.assert_allclose([motion.q, motion.v], swing(motion.time), atol=2e-3)
    if "v_ref" in names:  # the loss is that at the samples of the file
        back = [np.interp(time, motion.time, v) for v in motion.v.T]
        off = np.abs(np.stack(back, axis=1) - columns["v_ref"])
        np.testing.assert_allclose(loss.speed, off.max(axis=0), atol=1e-9)
    assert np.all(loss.position < 1e-3)


TIME = 0.001 * np.arange(2001)
FAST = np.sin(2 * np.pi * np.outer(TIME, [1, 24]))  # rad/s; chords of 5 ms leave out 7 % at most
_OFF = np.abs(np.interp(TIME, TIME[::5], FAST[::5, 1]) - FAST[:, 1]).max()
LOST = rf"at 0\.005 s joint 2 loses {_OFF:.3g} rad/s of speed at .*, allowed are 0\.021 rad/s"


@pytest.mark.parametrize(
    "time, columns, message",
    [
        (TIME, {"v_ref": FAST}, LOST),
        ([0, 0.1], {"v": np.zeros((2, 1))}, "neither v_ref_1 nor q_ref_1, expected time and"),
        (
            [0, 1],
            {"v_ref": FAST[:2, :1], "q_ref": FAST[:2]},
            r"2 column\(s\) q_ref_k and 1 v",
        ),
        ([0, 1e9], {"v_ref": FAST[:2]}, "1000000th"),
    ],
    ids=["loss", "columns", "joints", "periods"],
)
def test_motion_file_that_cannot_be_resampled_is_refused(tmp_path, time, columns, message):
    write_table(tmp_path / "in.csv", np.array(time, dtype=float), columns)
    with pytest.raises(InputError, match=rf"in\.csv: .*{message}"):
        import_motion(tmp_path / "in.csv", PERIOD)


def test_positions_alone_do_not_drift_and_end_is_rounded_up(tmp_path):
    time = 0.001 * np.arange(20003)
    q = np.stack([np.sin(time) ** 2, np.cos(3 * time)], axis=1)
    write_table(tmp_path / "in.csv", time, {"q_ref": q})
    motion, loss = import_motion(tmp_path / "in.csv", PERIOD)
    assert loss.position.max() < 9.0 * PERIOD**2 / 4 * 1.6  # a h² / 4, and a h² / 8 between samples
    assert motion.duration == pytest.approx(20.005) and loss.longer == pytest.approx(0.003)


def test_speeds_from_positions_are_those_of_the_cubic_spline():
    time = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.03, 200))
    q = np.sin(np.outer(time, [1.0, 3.0]))
    motion, _ = resampled("in.csv", time, q, None, PERIOD)
    spline = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(time - time[0], q.T)
    t = motion.time[1:-2]
    after, before = (spline.vector_values(at).T for at in (t + PERIOD, t - PERIOD))
    np.testing.assert_allclose(motion.v[1:-2], (after - before) / (2 * PERIOD), atol=1e-12)


def test_three_positions_make_a_parabola():
    time = np.array([0.0, 0.5, 1.25])
    motion, _ = resampled("in.csv", time, time[:, None] ** 2, None, PERIOD)
    np.testing.assert_allclose(motion.v[:, 0], 2 * motion.time, atol=1e-12)


def test_motion_csv_is_resampled_limited_and_retimed(robot, tmp_path):
    time, path = 0.032 * np.arange(126), tmp_path / "in.csv"
    write_table(path, time, {"v_ref": SWING.speeds(time)})
    plans = [load_plan(path, robot, period=PERIOD, planner=name) for name in PLANNERS]
    for plan in plans:
        np.testing.assert_allclose(plan.motion.v, SWING.speeds(plan.motion.time), atol=0.02)
        assert 0 < plan.loss.speed.max() < 0.02
    plans[0].motion.to_csv(tmp_path / "m.csv")
    weak = {"period": PERIOD, "torque_margin": 0.9 * plans[0].peak_use(robot).max()}
    with pytest.raises(InputError, match=r"m\.csv: joint \d .* at .* needs torque"):
        load_plan(tmp_path / "m.csv", robot, **weak)
    plan = load_plan(tmp_path / "m.csv", robot, **weak, planner="retiming")
    assert plan.longer > 0 and plan.loss is None
    with pytest.raises(InputError, match=r"in\.csv: .* 100 times as long"):
        load_plan(path, robot, period=PERIOD, torque_margin=1e-6, planner="retiming")
    with pytest.raises(InputError, match="planner: 'fast', expected one of limiter, retiming"):
        load_plan(path, robot, period=PERIOD, planner="fast")


def test_file_of_other_periods_or_without_a_column_is_resampled(tmp_path):
    """A motion file of the same period is taken as it is."""
    motion, path = sampled(SWING, 0.01), tmp_path / "motion.csv"
    motion.to_csv(path)
    for period in (0.01, 0.005):
        found, loss = import_motion(path, period)
        assert found.period == period and (loss is None) == (period == 0.01)
        assert found.duration == pytest.approx(motion.duration)
    write_table(path, motion.time, {"v_ref": motion.v})
    found, loss = import_motion(path, 0.01)
    assert loss is not None
    np.testing.assert_allclose(found.v, motion.v, atol=1e-12)


@pytest.mark.parametrize("start", [-0.01, 0.01])
def test_motion_file_starts_at_0(tmp_path, start):
    motion, path = sampled(SWING, 0.01), tmp_path / "motion.csv"
    write_table(path, motion.time + start, motion.columns)
    with pytest.raises(InputError, match=f"line 2: time starts at {start:g} s, expected 0"):
        Motion.from_csv(path)


@pytest.mark.parametrize(
    "period, times",
    [(0.1, 0.1 * np.arange(4)), (1 / 300, np.round(np.arange(301) / 300, 9))],
    ids=["written", "mean"],
)
def test_period_is_the_written_one_or_the_mean_of_rounded_times(tmp_path, period, times):
    motion = Motion.from_speeds(period, np.zeros(1), np.sin(times)[:, None])
    write_table(path := tmp_path / "m.csv", times, motion.columns)
    assert Motion.from_csv(path).period == period
