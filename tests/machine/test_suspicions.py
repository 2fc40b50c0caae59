"""What is said of recordings that are read otherwise than they are; the truth is known."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import simulated_recordings as simulated

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

from bench_suspicions import EXPECTED, NEUTRAL, recording
from dh import DATA, KUKA_KR300, UR10, needs_data

from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.identify.unexplained import delay_of
from sdt_drake.machine.recordings import Columns, read_recording
from sdt_drake.robot.robot import load_robot

CUTOFF = 6.0


def blames(found):
    """Suspicions of an identification."""
    return [line for line in found.warnings if not any(words in line for words in NEUTRAL)]


def said(robot, recorded):
    """Suspicions of a recording."""
    return blames(identify(robot, [recorded], cutoff=CUTOFF))


READ_OTHERWISE = {
    "kilo": "torque_factor: [1000, 1000, 1000]",
    "motor_side": "(--side motor)",
    "amperes": "torque_factor turns it into N m",
    "per_mille": "torque_factor is the rated torque",
    "swapped": "tau: in the order [1, 3, 2]",
    "reversed_order": "base to tip",
    "torque_sign": "torque_factor: [",
    "direction": "direction: [",
    "zero": "position_offset: [0, ",
    "wall": "gravity along [",
    "torque_late": "torque_delay: 0.01",
    "torque_of_one_late": "a torque that is ",
    "hysteresis": "joint 2: ",
    "spring": "joint 2: ",
    "drift": "temperature",
}


@pytest.mark.parametrize("fault", READ_OTHERWISE)
def test_a_fault_is_named_with_what_to_write(fault):
    robot, recorded = recording("arm3", fault, 4)
    lines = [line for line in said(robot, recorded) if EXPECTED[fault] in line]
    assert lines and READ_OTHERWISE[fault] in lines[0]


def test_swapped_torques_of_joints_that_move_alike_are_no_units():
    truth = simulated.truth("arm3", 2, together=True)
    (line,) = said(truth.robot, simulated.swapped(truth, np.random.default_rng(0)))
    assert EXPECTED["swapped"] in line


def test_nothing_is_said_of_clean_recordings():
    robot, recorded = recording("arm3", "", 30)
    found = identify(robot, [recorded], cutoff=CUTOFF)
    assert blames(found) == []
    clean = delay_of(found.equations, CUTOFF)
    assert abs(clean.common) < 5e-4 and not clean.is_significant
    late = replace(found.equations, time=found.equations.time + 1)  # a constant is no delay
    assert delay_of(late, CUTOFF).common == pytest.approx(clean.common, abs=1e-6)


@needs_data
def test_real_recordings_raise_no_false_suspicion(tmp_path):
    robot = load_robot(UR10.write(tmp_path))
    assert said(robot, read_recording(DATA / "ur10/exciting.csv", robot)) == []
    robot = load_robot(KUKA_KR300.write(tmp_path))
    columns = Columns(q=["q_motor_{k}"], tau=["motor_torque_{k}"], side="motor", v=[])
    for name in "AB":
        path = DATA / f"kuka_kr300/recording_{name}.csv"
        (line,) = said(robot, read_recording(path, robot, columns))  # 10 s excite little
        assert line.startswith("held-out data: ") and "drift, wear or another payload" in line
