"""LoadTorque alone: parity with Drake's inverse dynamics, and when it is evaluated."""

import dataclasses
import gc

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.controllers import InverseDynamics

from sdt_drake.errors import InputError
from sdt_drake.loops import make_loop
from sdt_drake.motion import Motion
from sdt_drake.robot import load_robot
from sdt_drake.simulate import make_simulator, simulate
from sdt_drake.systems import LoadTorque, load_torque_block, make_block
from sdt_drake.systems import load_torque as module

RNG = np.random.default_rng(6)
PORTS = ("load_torque", "alleviating_torque")


def samples(count, n=4):
    """References; some joints have no acceleration, some a huge one: all branches of Algorithm 1"""
    q, v = RNG.normal(size=(2, count, n))
    vd = RNG.normal(size=(count, n)) * RNG.choice([0, 0.3, 30], size=(count, n))
    return np.hstack([q, v, vd])


def torques(system, context, reference):
    system.GetInputPort("reference").FixValue(context, reference)
    return [system.GetOutputPort(name).Eval(context).copy() for name in PORTS]


def algorithm_1(own, coupled, r, sign):
    """As the paper prints it, for one joint."""
    tau = own + coupled
    if np.sign(own) == np.sign(coupled):
        return coupled / r, 0.0
    if abs(own) > abs(coupled):
        return 0.0, -coupled / r
    return (tau / r if sign == "consistent" else -tau / r), (tau - coupled) / r


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
    block = LoadTorque(robot=robot, sign=sign)
    own_context = block.CreateDefaultContext()
    for reference in samples(60):
        vd = reference[8:]
        drakes.get_input_port_estimated_state().FixValue(context, reference[:8])
        drakes.get_input_port_desired_acceleration().FixValue(context, vd)
        tau = drakes.get_output_port().Eval(context)
        plant.SetPositionsAndVelocities(links, reference[:8])
        own = plant.CalcMassMatrix(links).diagonal() * vd
        expected = np.transpose(
            [algorithm_1(own[k], tau[k] - own[k], robot.gear_ratio[k], sign) for k in range(4)]
        )
        np.testing.assert_allclose(
            torques(block, own_context, reference), expected, rtol=1e-9, atol=1e-8
        )


def test_split_adds_up_with_the_motors_taken_off(robot):
    """r (tau_LD - tau_alleviate) = CalcInverseDynamics - (d_kk + r² I_m) vd, published I_m and r"""
    r, rotor = np.array([67.2, 1, 1, 1]), np.array([0.1291, 1.73, 0.531, 0.531])
    plant = robot.plant
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    block = LoadTorque(robot=robot)
    own_context = block.CreateDefaultContext()
    for reference in samples(20):
        vd = reference[8:]
        plant.SetPositionsAndVelocities(context, reference[:8])
        plant.CalcForceElementsContribution(context, forces)  # gravity
        tau = plant.CalcInverseDynamics(context, vd, forces)
        # d_kk from unit accelerations at rest, without gravity
        plant.SetVelocities(context, np.zeros(4))
        none = MultibodyForces(plant)
        M = np.transpose([plant.CalcInverseDynamics(context, e, none) for e in np.eye(4)])
        d_kk = M.diagonal() - r**2 * rotor
        load, alleviating = torques(block, own_context, reference)
        np.testing.assert_allclose(
            r * (load - alleviating), tau - d_kk * vd - r**2 * rotor * vd, rtol=1e-9, atol=1e-8
        )


def test_evaluated_for_a_new_reference_and_for_nothing_else(robot, calls):
    block = LoadTorque(robot=robot)
    context = block.CreateDefaultContext()
    first, second = samples(2)
    block.GetInputPort("reference").FixValue(context, first)
    for time in (0.0, 1.7):
        for name in PORTS:  # the second output after time and accuracy have changed
            block.GetOutputPort(name).Eval(context)
            context.SetTime(time + 1)
            context.SetAccuracy(1e-3 / (1 + time))
    assert len(calls) == 1
    torques(block, context, second)
    assert len(calls) == 2
    np.testing.assert_array_equal(calls, [first, second])


def test_the_outputs_depend_on_the_reference_alone(robot):
    block = LoadTorque(robot=robot)
    tickets = {block.GetInputPort("reference").ticket()}
    for name in PORTS:
        entry = block.get_cache_entry(block.GetOutputPort(name).cache_entry().cache_index())
        assert entry.prerequisites() == tickets


@pytest.mark.parametrize("scenario", ["axis_pi_ctc", "coupled_pi_ctc"])
def test_evaluated_once_per_sample_in_a_run(make_variant, scenario, calls):
    def online_and_disturbed(scenario):
        scenario.inverse_dynamics = "online"
        scenario.disturbance.amplitude = 0.05  # something in the loop that depends on time

    design = make_variant(scenario, online_and_disturbed)
    q, v, vd = (a[420:521] for a in (design.motion.q, design.motion.v, design.motion.vd))
    simulate(dataclasses.replace(design, motion=Motion(design.motion.period, q, v, vd)))
    # The hold starts with the first sample, and takes it once more at time 0. The last sample acts
    # after the end.
    references = np.hstack([q, v, vd])
    np.testing.assert_array_equal(calls, [references[0], *references[:-1]])


def test_contexts_do_not_disturb_each_other(robot):
    block = LoadTorque(robot=robot)
    references = samples(3)
    alone = [torques(block, block.CreateDefaultContext(), reference) for reference in references]
    contexts = [block.CreateDefaultContext(), block.CreateDefaultContext()]
    torques(block, contexts[0], references[0])
    contexts.append(contexts[0].Clone())  # with what it has computed
    for context, reference in zip(contexts, references, strict=True):
        block.GetInputPort("reference").FixValue(context, reference)
    for k, name in enumerate(PORTS):  # by port, so that the contexts take turns
        for context, expected in zip(contexts, alone, strict=True):
            np.testing.assert_array_equal(
                block.GetOutputPort(name).Eval(context), expected[k], err_msg=name
            )


def test_outlives_what_it_was_made_from(robot):
    reference = samples(1)[0]
    block = LoadTorque(robot=robot)
    expected = torques(block, block.CreateDefaultContext(), reference)
    diagram = make_block("load_torque", load_torque_block, robot=load_robot(), sign="consistent")
    gc.collect()
    np.testing.assert_array_equal(
        torques(diagram, diagram.CreateDefaultContext(), reference), expected
    )


def test_loop_outlives_what_it_was_made_from(make_variant):
    """Nothing but the simulator is left, and it runs as before."""

    def simulator():
        def online(scenario):
            scenario.inverse_dynamics = "online"

        design = dataclasses.replace(make_variant("coupled_pi_ctc", online), robot=load_robot())
        return make_simulator(make_loop(design), max_step=design.motion.period)

    speeds = []
    for _ in range(2):
        alone = simulator()
        gc.collect()
        alone.AdvanceTo(0.1)
        speeds.append(alone.get_context().get_continuous_state_vector().CopyToVector())
    np.testing.assert_array_equal(*speeds)


def test_bad_sign_is_refused(robot):
    with pytest.raises(InputError, match="consistent, printed"):
        LoadTorque(robot=robot, sign="right")
