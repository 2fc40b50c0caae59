"""Recordings with faults: refused, named, or read all the same."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import simulated_recordings as simulated
from helpers.known_truth import changed, motion, recorded_of
from helpers.robots import chain_sdf, loaded

from sdt_drake.io.errors import InputError
from sdt_drake.machine.diagnose.finding import Finding
from sdt_drake.machine.diagnose.fit import driving
from sdt_drake.machine.diagnose.recording import check_recording
from sdt_drake.machine.identify.filtering import smooth, stretches
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.show.reports.identification import friction_table


def test_negative_friction_beyond_its_error_means_wrong_sign(robot, found):
    """A tool that the file does not have may turn its torque round, but not that of friction."""
    eq, one = found.equations, found.estimate
    turned, drives = replace(eq, nominal=-eq.nominal), replace(one, friction=-9 * one.friction)
    unsure = replace(drives, covariance=1e6 * one.covariance)
    for rows, estimate, count in ((turned, one, 0), (eq, drives, 4), (eq, unsure, 0)):
        joints = [one.joints for one in driving(rows, estimate)]
        assert joints == [(k + 1,) for k in range(count)]


def test_recording_without_excitation_is_refused(robot, true):
    recorded = recorded_of(true, seconds=8.0)
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
    still = changed(recorded, q=q * [1, 1, 0, 1] + noise)
    noisy = identify(robot, [still], cutoff=3.0)
    for words in ("joint 3 stands still: its friction", "base parameters are hardly excited"):
        assert sum(words in one.sentence for one in noisy.findings) == 1
    assert noisy.estimate.condition == np.inf
    rows = friction_table(noisy, noisy.plant_friction).rows
    assert rows[2] == ("3 pitch", *"––––––") and "±" in rows[1][2]
    short = Recorded(recorded.path, recorded.time[:50], {"q": q[:50], "tau": tau[:50]})
    with pytest.raises(InputError, match=r"0\.49 s at 100 Hz, expected at least 1 s"):
        identify(robot, [short])


def test_uneven_time_is_read_and_gaps_are_refused(robot, true):
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


# --- what is seen in a recording alone -------------------------------------------------------

FAULTS = {
    "logger_clock": ("uneven", "time: ", ""),
    "rounded": ("rounded", "time: ", "time: '', rate: 1"),
    "missing": ("missing", "time: ", ""),
    "repeated": ("repeated", "q: ", ""),
    "held": ("held", "tau: ", "torque_delay: 0.012"),
    "frozen_q": ("frozen", "q_", ""),
    "frozen_tau": ("frozen", "tau_", ""),
    "frozen_all_q": ("frozen", "q: all joints are frozen for 0.496 s", ""),
    "frozen_all_tau": ("frozen", "tau: all joints are frozen for 0.496 s", ""),
    "clipped": ("clipped", "tau_", ""),
    "speeds_in_degrees": ("speeds", "v_1: ", ""),
    "speeds_of_motors": ("speeds", "v_1: ", ""),
    "speeds_late": ("late speeds", "v: ", "v: []"),
    "clock": ("clock", "time: ", "time_factor: 2"),
    "degrees": ("degrees", "joint ", "angle: deg"),
    "of_motors": ("degrees", "joint ", "position_side: motor"),
}


@pytest.fixture(scope="module")
def arm():
    """A robot with six joints, recorded without any fault."""
    return simulated.truth("cobot", 1)


def found(truth, recorded) -> list[Finding]:
    return [x for x in check_recording(truth.robot, recorded) if x.kind != "at limit"]


@pytest.mark.parametrize("fault", FAULTS)
def test_recording_fault_is_named_with_columns_to_write(arm, fault):
    kind, begin, remedy = FAULTS[fault]
    said = found(arm, getattr(simulated, fault)(arm, np.random.default_rng(2)))
    assert {x.kind for x in said} == {kind}
    assert said[0].sentence.startswith(begin) and said[0].remedy.startswith(remedy)
    assert bool(remedy) == (" in the mapping file)" in str(said[0])) and said[0].evidence


MEANINGS = [  # what the file has, what its mapping says, and what is to be written
    (np.degrees, None, {}, "angle: deg"),
    (None, "motor", {}, "position_side: motor"),
    (np.degrees, "motor", {}, "angle: deg, position_side: motor"),
    (np.degrees, "motor", {"position_side": "motor"}, "angle: deg"),
    (None, None, {"angle": "deg"}, "angle: rad"),
    (lambda q: q / (2 * np.pi), None, {}, "angle: turn"),
    (lambda q: q / (2 * np.pi), "motor", {}, "angle: turn, position_side: motor"),
    (None, None, {"position_side": "motor"}, "position_side: joint"),
]


@pytest.mark.parametrize("unit, side, mapping, remedy", MEANINGS)
def test_meaning_of_positions_is_told_by_limits_and_torques(unit, side, mapping, remedy):
    """It is never the one that the mapping has, whatever the gear ratio is."""
    truth = simulated.truth("arm3", 2)
    robot, q = truth.robot, truth.recorded.signals["q"]
    q = robot.of_motors(q) if side else q
    q = unit(q) if unit else q
    columns = Columns(**mapping)
    q = robot.of_joints(q) if columns.position_side == "motor" else q
    q = np.radians(q) if columns.angle == "deg" else q
    signals = {"q": q, "tau": truth.recorded.signals["tau"]}
    wrong = replace(truth.recorded, signals=signals, columns=columns)
    (one,) = found(truth, wrong)
    assert (one.kind, one.remedy) == ("degrees", remedy)


def test_a_gear_of_1_is_no_reason_for_positions_or_speeds_of_motors():
    robot = loaded(chain_sdf(2, motors={"gear_ratio": np.ones(2)}))
    time = 0.01 * np.arange(1000)
    q = np.sin(time[:, None] * [1.0, 1.7])
    v = np.gradient(q, time, axis=0)
    for signals in ({"q": q, "v": np.degrees(v)}, {"q": np.degrees(q), "v": np.degrees(v)}):
        (one, *others) = check_recording(robot, Recorded(Path("r.csv"), time, signals))
        assert "in degrees" in str(one) and "motor" not in f"{one}{others}"


@pytest.mark.parametrize("name", simulated.ROBOTS)
def test_clean_recordings_have_no_finding(name):
    truth = simulated.truth(name, 20)
    assert found(truth, truth.recorded) == []


def test_uneven_steps_of_samples_at_their_times_are_no_finding(arm):
    """Nothing could be done about them."""
    assert found(arm, simulated.jitter(arm, np.random.default_rng(2))) == []
