"""What is said of recordings that something is wrong with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_truth import changed, motion, recorded_of, true_robot

from sdt_drake.io.errors import InputError
from sdt_drake.machine.identify.filtering import smooth, stretches
from sdt_drake.machine.identify.model import plant_friction
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.identify.suspicions import suspicious_torques
from sdt_drake.machine.recordings import Recorded, check_recording
from sdt_drake.show.reports.identification import friction_table


@pytest.fixture(scope="module")
def true(robot):
    return true_robot(robot)


def suspicions(robot, recorded):
    return " / ".join(identify(robot, [recorded], cutoff=3.0).warnings)


def test_what_looks_wrong_is_said(robot, true):
    recorded = recorded_of(true, seconds=8.0)
    q, tau = recorded.signals["q"], recorded.signals["tau"]
    assert "are its positions in degrees?" in suspicions(robot, changed(recorded, q=np.degrees(q)))
    motors = suspicions(robot, changed(recorded, tau=tau / robot.gear_ratio))
    assert (
        "tau_1: about 0.0161 times the torque of the file: is it of the motors (--side mot"
        in motors
    )
    for unit, factor in (("kN m", 1000), ("N mm", 0.001)):
        other = suspicions(robot, changed(recorded, tau=tau / factor))
        assert (
            f" times the torque of the file: is it in {unit} (torque_factor: "
            f"[{factor}, {factor}, {factor}, {factor}] in the mapping file)?"
        ) in other
        assert "drives" not in other and unit not in motors
    sign = suspicions(robot, changed(recorded, tau=tau * [1, 1, -1, 1]))
    assert "by tau_3 with the opposite sign (torque_factor: [1, 1, -1, 1] in" in sign
    assert "by 8 % instead of 193 % with the file's links" in sign
    swapped = suspicions(robot, changed(recorded, tau=tau[:, [0, 2, 1, 3]]))
    assert "by tau_2 and tau_3 swapped (tau: in the order [1, 3, 2, 4]" in swapped
    speeds = suspicions(robot, changed(recorded, v=np.degrees(np.gradient(q, 0.01, axis=0))))
    assert "v_1: is 57.3 times the derivative of q_1: one of them is in degrees" in speeds
    limit = robot.effort_limit * 0.1
    assert "motor 2 is at its limit for" in suspicions(
        replace(robot, effort_limit=limit), changed(recorded, tau=np.clip(tau, -limit, limit))
    )
    still = identify(robot, [changed(recorded, q=q * [1, 1, 0, 1])], cutoff=3.0).warnings
    assert any("joint 3 stands still" in line for line in still)
    assert any("base parameters are hardly excited" in line for line in still)


def test_a_wrong_file_is_no_wrong_sign(robot, true):
    """A tool that the file does not have may turn its torque round, but not that of friction."""
    found = identify(robot, [recorded_of(true, seconds=8.0)], cutoff=3.0)
    eq, one = found.equations, found.estimate
    turned, driving = replace(eq, nominal=-eq.nominal), replace(one, friction=-9 * one.friction)
    unsure = replace(driving, covariance=1e6 * one.covariance)
    for rows, estimate, count in ((turned, one, 0), (eq, driving, 4), (eq, unsure, 0)):
        lines = suspicious_torques(robot, rows, estimate, found.predicted, 3.0)
        assert sum("drives instead of braking" in line for line in lines) == count


def test_joints_that_rest_where_they_are_judged_are_told(robot, true):
    recorded = recorded_of(true)
    q, third = np.array(recorded.signals["q"]), len(recorded.time) // 3
    q[-third - 200 :, 2] = q[-third - 200, 2]
    said = suspicions(robot, changed(recorded, q=q))
    assert "joint 3 stands still in the held-out data: its torque is not validated" in said
    assert said.count("stands still") == 1
    flipped = changed(recorded, q=q[::-1].copy())
    judged = identify(robot, [flipped], held_out=1 / 4, cutoff=3.0)
    assert not any("stands still" in line for line in judged.warnings)
    first = identify(robot, [flipped], held_out=0.7, cutoff=3.0).warnings
    assert any("joint 3 stands still in the fitted data" in line for line in first)


def test_a_joint_without_stops_may_turn_on_and_on(robot, true):
    recorded = recorded_of(true, seconds=8.0)
    q, time = recorded.signals["q"], recorded.time
    spun = changed(recorded, q=q + np.outer(time, [1.0, 0, 0, 0]) * 7)
    assert np.ptp(spun.signals["q"][:, 0]) > 50 and np.isinf(robot.position_upper[0])
    fast = replace(robot, velocity_limit=np.full(4, 10.0))
    assert "degrees" not in {found.kind for found in check_recording(fast, spun)}
    short = replace(fast, position_lower=np.full(4, -1.0), position_upper=np.full(4, 1.0))
    assert "degrees" in {found.kind for found in check_recording(short, spun)}


def test_recordings_that_say_nothing_are_refused(robot, true):
    recorded = recorded_of(true)
    tau, q = recorded.signals["tau"], recorded.signals["q"]
    with pytest.raises(InputError, match=r"truth\.csv: tau_2: 0 N m in all samples"):
        identify(robot, [changed(recorded, tau=tau * [1, 0, 1, 1])])
    again = replace(changed(recorded, tau=tau.copy()), path=Path("copy.csv"))
    for more in ({"validate": [again]}, {"recordings": [recorded, again]}):
        with pytest.raises(
            InputError, match=r"^copy\.csv: has the same data as truth\.csv, expected"
        ):
            identify(robot, **{"recordings": [recorded], **more})
    with pytest.raises(InputError, match=r"truth\.csv: no joint moves"):
        identify(robot, [changed(recorded, q=np.zeros_like(q))])
    noise = 1e-5 * np.random.default_rng(0).normal(size=q.shape)
    with pytest.raises(InputError, match=r"truth\.csv: no joint moves more than the noise"):
        identify(robot, [changed(recorded, q=noise)])
    noisy = identify(robot, [changed(recorded, q=q * [1, 1, 0, 1] + noise)], cutoff=3.0)
    assert any("joint 3 stands still" in line for line in noisy.warnings)
    assert sum("stands still" in line for line in noisy.warnings) == 1
    assert noisy.estimate.condition == np.inf
    rows = friction_table(noisy, plant_friction(noisy)).rows
    assert rows[2] == ("3 pitch", *"––––––") and "±" in rows[1][2]
    short = Recorded(recorded.path, recorded.time[:50], {"q": q[:50], "tau": tau[:50]})
    with pytest.raises(InputError, match=r"0\.49 s at 100 Hz, expected at least 1 s"):
        identify(robot, [short])


def test_uneven_time_and_gaps(robot, true):
    recorded = recorded_of(true, noise=0.0)
    rng = np.random.default_rng(5)
    kept = np.sort(rng.permutation(len(recorded.time))[: int(0.97 * len(recorded.time))])
    kept = kept[(kept < 700) | (kept > 760)]
    holes = Recorded(
        recorded.path, recorded.time[kept], {k: x[kept] for k, x in recorded.signals.items()}
    )
    parts, notes = stretches(holes)
    assert len(parts) == 2 and "1 gap(s) in time" in notes[0] and "uneven time" in notes[1]
    _, q, v, vd = motion(robot)
    for part in parts:
        one = smooth(part, 4.0)
        at = np.arange(20, len(one.time) - 20)
        for values, exact in ((one.q, q), (one.v, v), (one.vd, vd)):
            wanted = np.column_stack([np.interp(one.time[at], recorded.time, x) for x in exact.T])
            assert np.abs(values[at] - wanted).max() < 0.02 * np.abs(exact).max()
