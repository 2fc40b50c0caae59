"""What is said of recordings that are read otherwise than they are; the truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import simulated_recordings as simulated
from helpers.faults import blames, names, recording
from oracles.dh import DATA, KUKA_KR300, UR10, needs_data

from sdt_drake.machine.diagnose.finding import kinds
from sdt_drake.machine.diagnose.recording import check_recording
from sdt_drake.machine.diagnose.residual import delay_of
from sdt_drake.machine.identify.judge import judge
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.machine.recordings.reading import read_recording
from sdt_drake.robot.robot import load_robot

CUTOFF = 6.0


def said(robot, recorded):
    """What blames a recording."""
    return blames(identify(robot, [recorded], cutoff=CUTOFF))


REMEDIES = {
    "kilo": "torque_factor: [1000, 1000, 1000]",
    "motor_side": "side: motor",
    "amperes": "",
    "per_mille": "",
    "swapped": "tau: in the order [1, 3, 2]",
    "reversed_order": "q and tau: in the order of the joints, base to tip",
    "torque_sign": "torque_factor: [1, 1, -1]",
    "direction": "direction: [1, 1, -1]",
    "zero": "position_offset: [0, -1.5708, 0]",
    "wall": "",
    "torque_late": "torque_delay: 0.01",
    "torque_of_one_late": "",
    "hysteresis": "",
    "spring": "",
    "drift": "",
}


@pytest.mark.parametrize("fault", REMEDIES)
def test_fault_is_named_with_remedy_and_evidence(fault):
    robot, recorded = recording("arm3", fault, 4)
    found = said(robot, recorded)
    one = next(one for one in found if names(one, fault))
    assert one.remedy.startswith(REMEDIES[fault]) and bool(one.remedy) == bool(REMEDIES[fault])
    assert all(one.evidence and np.isfinite([*one.evidence.values()]).all() for one in found)
    assert {one.kind for one in found} <= kinds().keys()


def test_evidence_equals_the_fault_put_in():
    """Torques 12 ms late; torques in kN m."""
    late, *_ = said(*recording("arm3", "torque_late", 4))
    assert late.evidence["delay_s"] == pytest.approx(0.012, abs=4 * late.evidence["error_s"])
    (kilo,) = said(*recording("arm3", "kilo", 4))
    assert kilo.joints == (1, 2, 3)
    assert 5e-4 < kilo.evidence["least_times"] <= kilo.evidence["most_times"] < 2e-3


def test_judge_gives_the_findings_of_the_check():
    robot, recorded = recording("arm3", "degrees", 4)
    assert judge(robot, [recorded], cutoff=CUTOFF).findings == tuple(
        check_recording(robot, recorded)
    )


def test_swapped_torques_of_alike_motions_are_not_taken_for_units():
    truth = simulated.truth("arm3", 2, together=True)
    (one,) = said(truth.robot, simulated.swapped(truth, np.random.default_rng(0)))
    assert names(one, "swapped")


def test_clean_simulated_recordings_have_no_finding():
    robot, recorded = recording("arm3", "", 30)
    found = identify(robot, [recorded], cutoff=CUTOFF)
    assert blames(found) == []
    clean = delay_of(found.equations, CUTOFF)
    assert abs(clean.common) < 5e-4 and not clean.is_significant
    late = replace(found.equations, time=found.equations.time + 1)  # a constant is no delay
    assert delay_of(late, CUTOFF).common == pytest.approx(clean.common, abs=1e-6)


@needs_data
def test_published_recordings_raise_no_false_finding(tmp_path):
    robot = load_robot(UR10.write(tmp_path))
    assert said(robot, read_recording(DATA / "ur10/exciting.csv", robot)) == []
    robot = load_robot(KUKA_KR300.write(tmp_path))
    columns = Columns(q=["q_motor_{k}"], tau=["motor_torque_{k}"], side="motor", v=[])
    for name in "AB":
        path = DATA / f"kuka_kr300/recording_{name}.csv"
        (one,) = said(robot, read_recording(path, robot, columns))  # 10 s excite little
        assert one.kind == "held out" and "drift, wear or another payload" in one.sentence
