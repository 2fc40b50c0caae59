"""Torques of the reference alone: parity with Drake's inverse dynamics, and when evaluated."""

import dataclasses
import gc

import numpy as np
import pytest
from alone import Alone
from pydrake.systems.controllers import InverseDynamics

from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Friction
from sdt_drake.robot.dynamics import decouple
from sdt_drake.robot.robot import load_robot
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import make_simulator, simulate
from sdt_drake.systems import load_torque as module
from sdt_drake.systems.gains import feedforward_torque

RNG = np.random.default_rng(6)
R = np.array([67.2, 1, 1, 1])
PORTS = ("load_torque", "alleviating_torque")


def samples(count, n=4):
    """References; some joints have no acceleration, some a huge one: all branches of Algorithm 1"""
    q, v = RNG.normal(size=(2, count, n))
    vd = RNG.normal(size=(count, n)) * RNG.choice([0, 0.3, 30], size=(count, n))
    return np.hstack([q, v, vd])


def torques(block, reference, ports=PORTS):
    block.give(reference=reference)
    return [block.output(name) for name in ports]


def id_block(robot):
    def law(groups, v, vd):
        return [feedforward_torque("id", robot, groups, vd, "consistent")]

    return Alone("ReferenceTorque", robot, outputs=("tau_ff",), law=law)


@pytest.fixture
def calls(monkeypatch):
    """The references that inverse dynamics was computed for."""
    seen, real = [], module.groups_of_sample

    def counted(robot, context, q_and_v, vd):
        seen.append(np.concatenate([q_and_v, vd]))
        return real(robot, context, q_and_v, vd)

    monkeypatch.setattr(module, "groups_of_sample", counted)
    return seen


@pytest.mark.parametrize("sign", ["consistent", "printed"])
def test_parity_with_drakes_inverse_dynamics(robot, sign):
    """Links alone: the rotors' inertia is set to zero in the parameters of Drake's context."""
    plant = robot.plant
    links = plant.CreateDefaultContext()
    for index in plant.GetJointActuatorIndices():
        plant.get_joint_actuator(index).SetRotorInertia(links, 0.0)
    drakes = InverseDynamics(plant, plant_context=links)
    context = drakes.CreateDefaultContext()
    block = Alone("LoadTorque", robot, algorithm=sign)
    for reference in samples(60):
        vd = reference[8:]
        drakes.get_input_port_estimated_state().FixValue(context, reference[:8])
        drakes.get_input_port_desired_acceleration().FixValue(context, vd)
        tau = drakes.get_output_port().Eval(context)
        plant.SetPositionsAndVelocities(links, reference[:8])
        own = plant.CalcMassMatrix(links).diagonal() * vd
        split = decouple(own, tau - own, R, sign)
        np.testing.assert_allclose(torques(block, reference), split, rtol=1e-9, atol=1e-8)


def test_feedforward_gets_its_models_torque_groups_and_the_reference(robot):
    """With the law of "id" it is Drake's inverse dynamics, with the rotors, motor side."""
    drakes = InverseDynamics(robot.plant)
    context = drakes.CreateDefaultContext()
    block = id_block(robot)
    speeds = Alone("ReferenceTorque", robot, outputs=("tau_ff",), law=lambda _, v, vd: [v])
    for reference in samples(30):
        drakes.get_input_port_estimated_state().FixValue(context, reference[:8])
        drakes.get_input_port_desired_acceleration().FixValue(context, reference[8:])
        expected = drakes.get_output_port().Eval(context) / R
        (tau_ff,) = torques(block, reference, ["tau_ff"])
        np.testing.assert_allclose(tau_ff, expected, rtol=1e-9, atol=1e-8)
        np.testing.assert_array_equal(torques(speeds, reference, ["tau_ff"])[0], reference[4:8])


@pytest.mark.parametrize("sign", ["consistent", "printed"])
@pytest.mark.parametrize("kind", ["none", "ctc", "id"])
def test_feedforward_of_a_design(designed, kind, sign):
    """Gains on the torque of the model, and not on friction, which comes from the joint side."""
    gain = np.array([0.9, 1.1, 0.0, -1.0])
    fields = {
        "algorithm": sign,
        "plant.friction": Friction([300.0] * 4, [20.0] * 4),
        "controller.kind": "p_pi",
        "controller.feedforward": kind,
        "controller.friction_compensation": True,
        "controller.feedforward_gain": None if kind == "none" else gain.tolist(),
        "controller.model": Deviation(inertia_scale=1.2),
    }
    design = designed("coupled_pi", fields, end=0.1)
    law = design.feedforward
    block = Alone(
        "ReferenceTorque", design.model, outputs=("tau_ff",), law=lambda *sample: [law(*sample)]
    )
    loads, whole = Alone("LoadTorque", design.model, algorithm=sign), id_block(design.model)
    for reference in samples(5):
        of_model = {
            "none": 0.0,
            "ctc": torques(loads, reference)[0],
            "id": torques(whole, reference, ["tau_ff"])[0],
        }
        v = reference[4:8]
        expected = gain * of_model[kind] + (300 * np.sign(v) + 20 * v) / R
        (tau_ff,) = torques(block, reference, ["tau_ff"])
        np.testing.assert_allclose(tau_ff, expected, rtol=1e-12, atol=1e-9)


# --- when evaluated --------------------------------------------------------------------------


def test_evaluated_for_a_new_reference_and_for_nothing_else(robot, calls):
    """Its outputs depend on the reference alone, not on time or accuracy."""
    block = Alone("LoadTorque", robot)
    first, second = samples(2)
    block.give(reference=first)
    for time in (0.0, 1.7):
        for name in PORTS:
            block.output(name)
            block.context.SetTime(time + 1)
            block.context.SetAccuracy(1e-3 / (1 + time))
    assert len(calls) == 1
    torques(block, second)
    np.testing.assert_array_equal(calls, [first, second])
    tickets = {block.system.GetInputPort("reference").ticket()}
    for name in PORTS:
        cache_index = block.system.GetOutputPort(name).cache_entry().cache_index()
        assert block.system.get_cache_entry(cache_index).prerequisites() == tickets


@pytest.mark.parametrize(
    ("scenario", "kind", "blocks"),
    [("axis_pi_ctc", "pi_ctc", 1), ("coupled_pi_ctc", "pi_ctc", 1), ("coupled_pi_ctc", "pi_id", 2)],
)
def test_evaluated_once_per_sample_in_a_run(designed, scenario, kind, blocks, calls):
    fields = {"inverse_dynamics": "online", "controller.kind": kind}
    # Something in the loop that depends on time.
    design = designed(scenario, fields | {"disturbance.amplitude": 0.05}, start=2.1, end=2.6)
    motion = design.motion
    calls.clear()
    simulate(design)
    references = np.hstack([motion.q, motion.v, motion.vd])
    counts = [np.sum((calls == reference).all(axis=1)) for reference in references]
    assert len(calls) == sum(counts)
    # The run starts with the first sample, and takes it once more at time 0. The last acts after
    # the end.
    assert counts[1:] == [blocks] * (len(counts) - 2) + [0]
    assert blocks <= counts[0] <= 2 * blocks


def test_contexts_do_not_disturb_each_other(robot):
    references = samples(3)
    alone = [torques(Alone("LoadTorque", robot), reference) for reference in references]
    blocks = [Alone("LoadTorque", robot) for _ in range(3)]
    system = blocks[0].system
    blocks[1].system, blocks[1].context = system, system.CreateDefaultContext()
    torques(blocks[0], references[0])
    blocks[2].system, blocks[2].context = system, blocks[0].context.Clone()  # as computed
    for block, reference in zip(blocks, references, strict=True):
        block.give(reference=reference)
    for k, name in enumerate(PORTS):  # by port, so that the contexts take turns
        for block, expected in zip(blocks, alone, strict=True):
            np.testing.assert_array_equal(block.output(name), expected[k], err_msg=name)


def test_outlives_what_it_was_made_from(robot, designed):
    """Nothing but the block, or the simulator, is left, and it runs as before."""
    reference = samples(1)[0]

    def simulator():
        online = designed("coupled_pi_ctc", {"inverse_dynamics": "online"}, end=0.2)
        design = dataclasses.replace(online, nominal=load_robot())
        return make_simulator(make_loop(design), period=design.motion.period, accuracy=1e-4)

    found = []
    for own in (robot, None):
        load, fed = Alone("LoadTorque", own or load_robot()), id_block(own or load_robot())
        alone = simulator()
        gc.collect()
        alone.AdvanceTo(0.1)
        speeds = alone.get_context().get_continuous_state_vector().CopyToVector()
        fed_forward = torques(fed, reference, ["tau_ff"])
        found.append(np.concatenate([*torques(load, reference), *fed_forward, speeds]))
    np.testing.assert_array_equal(*found)
