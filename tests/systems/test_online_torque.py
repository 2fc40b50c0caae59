"""Torques of the reference online: when they are evaluated."""

import dataclasses
import gc

import numpy as np
import pytest

from sdt_drake.robot.robot import load_robot
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import make_simulator, simulate
from sdt_drake.systems import load_torque as module


@pytest.fixture
def calls(monkeypatch):
    """The references that inverse dynamics was computed for."""
    seen, real = [], module.groups_of_sample

    def counted(robot, context, q_and_v, vd):
        seen.append(np.concatenate([q_and_v, vd]))
        return real(robot, context, q_and_v, vd)

    monkeypatch.setattr(module, "groups_of_sample", counted)
    return seen


def test_torques_are_evaluated_once_per_sample_in_a_run(designed, calls):
    # With a disturbance the loop depends on time. Both the load torque and the feedforward use it.
    fields = {"inverse_dynamics": "online", "controller.kind": "pi_id"}
    fields |= {"disturbance.amplitude": 0.05}
    design = designed("coupled_pi_ctc", fields, start=2.1, end=2.4)
    motion = design.motion
    calls.clear()
    simulate(design)
    references = np.hstack([motion.q, motion.v, motion.vd])
    counts = [np.sum((calls == reference).all(axis=1)) for reference in references]
    assert len(calls) == sum(counts)
    # The start takes the first sample, too; the last acts after the end.
    assert counts[1:] == [2] * (len(counts) - 2) + [0] and 2 <= counts[0] <= 4


def test_a_simulator_outlives_its_robot_and_design(robot, designed):
    online = designed("coupled_pi_ctc", {"inverse_dynamics": "online"}, end=0.2)

    def speeds(nominal):
        loop = make_loop(dataclasses.replace(online, nominal=nominal()))
        simulator = make_simulator(loop, period=online.motion.period, accuracy=1e-4)
        del loop
        gc.collect()
        simulator.AdvanceTo(0.1)
        return simulator.get_context().get_continuous_state_vector().CopyToVector()

    np.testing.assert_array_equal(speeds(load_robot), speeds(lambda: robot))
