"""Motions: exact integrals, exact times, exact files, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion


def random_motion(period: float, *, n: int = 3, count: int = 400) -> Motion:
    rng = np.random.default_rng(0)
    return Motion.from_speeds(period, rng.normal(size=n), rng.normal(size=(count + 1, n)))


def test_integrals_of_a_motion_are_those_computed_by_hand():
    motion = Motion.from_speeds(0.5, np.array([1.0]), np.array([[0.0], [2.0], [2.0], [-2.0]]))
    np.testing.assert_allclose(motion.vd, [[4], [0], [-8], [0]], atol=1e-15)
    np.testing.assert_allclose(motion.q, [[1], [1.5], [2.5], [2.5]], atol=1e-15)
    assert (motion.n, motion.duration) == (1, 1.5)
    assert motion.summary().title == "of 1 joint: 1.5 s in steps of 500 ms"


def test_drake_trajectory_has_the_same_positions_speeds_and_accelerations():
    motion = random_motion(0.01)
    trajectory = motion.trajectory
    speed, acceleration = trajectory.MakeDerivative(1), trajectory.MakeDerivative(2)
    assert trajectory.end_time() == motion.duration
    for share in (0, 0.3, 0.9):  # of a period
        dt = share * motion.period
        time = motion.time[:-1] + dt
        q, v, vd = motion.q[:-1], motion.v[:-1], motion.vd[:-1]
        np.testing.assert_allclose(
            trajectory.vector_values(time).T, q + v * dt + vd * dt**2 / 2, atol=1e-12
        )
        np.testing.assert_allclose(speed.vector_values(time).T, v + vd * dt, atol=1e-9)
        np.testing.assert_allclose(acceleration.vector_values(time).T, vd, atol=1e-6)
    np.testing.assert_allclose(trajectory.value(motion.duration)[:, 0], motion.q[-1], atol=1e-12)


@pytest.mark.parametrize("period", [0.005, 0.001, 0.1, 1 / 3, 1 / 300])
def test_a_motion_comes_back_from_its_csv_bit_by_bit(tmp_path, period):
    motion = random_motion(period)
    motion.to_csv(tmp_path / "motion.csv")
    back = Motion.from_csv(tmp_path / "motion.csv")
    for name in ("q", "v", "vd", "time"):
        np.testing.assert_array_equal(getattr(back, name), getattr(motion, name), err_msg=name)
    assert back.period == period


# --- files -----------------------------------------------------------------------------------

# 0.5 s steps: q = t² / 2 up to 1 s, then constant speed.
CSV = """time,q_ref_1,v_ref_1,vd_ref_1
0.0,0,0,1
0.5,0.125,0.5,1
1.0,0.5,1,0
1.5,1.0,1,0
"""


def _load(tmp_path, text):
    path = tmp_path / "motion.csv"
    path.write_text(text, encoding="utf-8")
    return Motion.from_csv(path)


def _with_column(name, values):
    rows = zip(CSV.splitlines(), [name, *values], strict=True)
    return "\n".join(f"{row},{value}" for row, value in rows)


@pytest.mark.parametrize("name", ["tau_1", "temperature"])
def test_further_columns_are_ignored(tmp_path, name):
    motion = _load(tmp_path, _with_column(name, [9, 8, 7, 6]))
    np.testing.assert_array_equal(motion.q, [[0], [0.125], [0.5], [1]])
    np.testing.assert_array_equal(motion.v, [[0], [0.5], [1], [1]])
    np.testing.assert_array_equal(motion.vd, [[1], [1], [0], [0]])
    assert motion.period == 0.5


BAD = [
    (CSV.replace("v_ref", "speed"), ": no column v_ref_1, expected time, q_ref_k, v_ref_k"),
    (CSV.replace("vd_ref", "x"), ": no column vd_ref_1"),
    (CSV.replace("q_ref", "q"), ": no column q_ref_1"),
    (_with_column("q_ref_2", [0, 0, 0, 0]), ".*differ in their number of joints"),
    (CSV.replace("0.5,0.125", "0.7,0.125"), ", line 4: time goes from"),
    (
        "time,q_ref_1,v_ref_1,vd_ref_1\n0.5,0,0,0\n1.0,0,0,0\n",
        r", line 2: time starts at 0\.5 s, expected 0",
    ),
    (
        CSV.replace("0.5,1\n", "0.5,0.9\n"),
        r", line 3: vd_ref_1 does not fit v_ref_1: 0\.9, .* give 1",
    ),
    (
        CSV.replace("1.5,1.0", "1.5,1.1"),
        r", line 5: q_ref_1 does not fit v_ref_1: 1\.1, .* give 1$",
    ),
    # The last acceleration is held beyond the motion.
    (CSV.replace("1.0,1,0", "1.0,1,7"), ", line 5: vd_ref_1"),
]


@pytest.mark.parametrize("text, message", BAD, ids=[case[-1] for case in BAD])
def test_a_csv_that_is_no_motion_is_refused_with_line_and_numbers(tmp_path, text, message):
    assert text != CSV
    with pytest.raises(InputError, match=rf"motion\.csv{message}"):
        _load(tmp_path, text)


def test_positions_that_stand_still_at_a_small_speed_are_refused(tmp_path):
    # 1e-4 rad/s over 60 s are 6 mrad, but only 5e-7 rad in each period.
    moving = Motion.from_speeds(0.005, np.zeros(1), np.full((12001, 1), 1e-4))
    Motion(0.005, np.zeros_like(moving.q), moving.v, moving.vd).to_csv(tmp_path / "motion.csv")
    with pytest.raises(InputError, match="q_ref_1 does not fit v_ref_1"):
        Motion.from_csv(tmp_path / "motion.csv")
