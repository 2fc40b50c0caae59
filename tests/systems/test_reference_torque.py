"""Torques of the reference alone: parity with Drake's inverse dynamics, and when evaluated."""

import dataclasses
import gc

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.controllers import InverseDynamics

from sdt_drake.deviation import Deviation, deviated
from sdt_drake.errors import InputError
from sdt_drake.loops import make_loop
from sdt_drake.motion import Motion
from sdt_drake.robot import load_robot
from sdt_drake.simulate import make_simulator, simulate
from sdt_drake.systems import (
    ReferenceTorque,
    feedforward_torque_block,
    load_torque_block,
    make_block,
)
from sdt_drake.systems import reference_torque as module

RNG = np.random.default_rng(6)
PORTS = ("load_torque", "alleviating_torque")


def samples(count, n=4):
    """References; some joints have no acceleration, some a huge one: all branches of Algorithm 1"""
    q, v = RNG.normal(size=(2, count, n))
    vd = RNG.normal(size=(count, n)) * RNG.choice([0, 0.3, 30], size=(count, n))
    return np.hstack([q, v, vd])


def load_torque(robot, sign="consistent"):
    return make_block("load_torque", load_torque_block, robot=robot, sign=sign)


def feedforward_torque(robot, feedforward, sign="consistent", gain=1.0, friction=np.zeros_like):
    return make_block(
        "feedforward_torque",
        feedforward_torque_block,
        model=robot,
        feedforward=feedforward,
        sign=sign,
        gain=gain * np.ones(robot.n),
        friction=friction,
    )


def torques(system, context, reference, ports=PORTS):
    system.GetInputPort("reference").FixValue(context, reference)
    return [system.GetOutputPort(name).Eval(context).copy() for name in ports]


def tau_ff(system, reference):
    return torques(system, system.CreateDefaultContext(), reference, ["tau_ff"])[0]


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
    block = load_torque(robot, sign)
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
    block = load_torque(robot)
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
    block = load_torque(robot)
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
    block = ReferenceTorque(robot=robot, outputs=PORTS, law=lambda *_: [np.zeros(4)] * 2)
    tickets = {block.GetInputPort("reference").ticket()}
    for name in PORTS:
        entry = block.get_cache_entry(block.GetOutputPort(name).cache_entry().cache_index())
        assert entry.prerequisites() == tickets


@pytest.mark.parametrize(
    ("scenario", "kind", "blocks"),
    [("axis_pi_ctc", "pi_ctc", 1), ("coupled_pi_ctc", "pi_ctc", 1), ("coupled_pi_ctc", "pi_id", 2)],
)
def test_evaluated_once_per_sample_in_a_run(make_variant, scenario, kind, blocks, calls):
    def online_and_disturbed(scenario):
        scenario.inverse_dynamics = "online"
        scenario.disturbance.amplitude = 0.05  # something in the loop that depends on time
        scenario.controller.kind = kind

    design = make_variant(scenario, online_and_disturbed)
    q, v, vd = (a[420:521] for a in (design.motion.q, design.motion.v, design.motion.vd))
    simulate(dataclasses.replace(design, motion=Motion(design.motion.period, q, v, vd)))
    # The hold starts with the first sample, and takes it once more at time 0. The last sample acts
    # after the end.
    references = np.hstack([q, v, vd])
    expected = np.repeat([references[0], *references[:-1]], blocks, axis=0)
    np.testing.assert_array_equal(calls, expected)


def test_contexts_do_not_disturb_each_other(robot):
    block = load_torque(robot)
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
    block = load_torque(robot)
    expected = torques(block, block.CreateDefaultContext(), reference)
    fed_forward = tau_ff(feedforward_torque(robot, "id"), reference)
    diagram, feedforward = load_torque(load_robot()), feedforward_torque(load_robot(), "id")
    gc.collect()
    np.testing.assert_array_equal(
        torques(diagram, diagram.CreateDefaultContext(), reference), expected
    )
    np.testing.assert_array_equal(tau_ff(feedforward, reference), fed_forward)


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


# --- feedforward -----------------------------------------------------------------------------


def test_id_is_drakes_inverse_dynamics_with_the_rotors(robot):
    """What the motors need, motor side, with r² I_m in the mass matrix of Drake's plant."""
    drakes = InverseDynamics(robot.plant)
    context = drakes.CreateDefaultContext()
    block = feedforward_torque(robot, "id")
    for reference in samples(60):
        drakes.get_input_port_estimated_state().FixValue(context, reference[:8])
        drakes.get_input_port_desired_acceleration().FixValue(context, reference[8:])
        expected = drakes.get_output_port().Eval(context) / [67.2, 1, 1, 1]
        np.testing.assert_allclose(tau_ff(block, reference), expected, rtol=1e-9, atol=1e-8)


def test_id_adds_the_rotors_to_the_links(robot):
    """r² I_m vd, of the published I_m and r: nothing else lies between it and Algorithm 1."""
    r, rotor = np.array([67.2, 1, 1, 1]), np.array([0.1291, 1.73, 0.531, 0.531])
    loads, block = load_torque(robot), feedforward_torque(robot, "id")
    context = robot.plant.CreateDefaultContext()
    for reference in samples(20):
        load, alleviating = torques(loads, loads.CreateDefaultContext(), reference)
        robot.plant.SetPositions(context, reference[:4])
        M_kk = robot.plant.CalcMassMatrix(context).diagonal()
        links = (M_kk - r**2 * rotor) * reference[8:]
        expected = load - alleviating + links / r + r * rotor * reference[8:]
        np.testing.assert_allclose(tau_ff(block, reference), expected, rtol=1e-9, atol=1e-8)


@pytest.mark.parametrize("sign", ["consistent", "printed"])
def test_ctc_is_the_load_torque(robot, sign):
    loads, block = load_torque(robot, sign), feedforward_torque(robot, "ctc", sign)
    for reference in samples(30):
        load, _ = torques(loads, loads.CreateDefaultContext(), reference)
        np.testing.assert_array_equal(tau_ff(block, reference), load)


@pytest.mark.parametrize(("feedforward", "same"), [("none", True), ("ctc", False), ("id", True)])
def test_the_sign_matters_in_ctc_alone(robot, feedforward, same):
    consistent, printed = (
        feedforward_torque(robot, feedforward, sign) for sign in ("consistent", "printed")
    )
    pairs = [(tau_ff(consistent, each), tau_ff(printed, each)) for each in samples(30)]
    assert all(np.array_equal(*pair) for pair in pairs) == same


@pytest.mark.parametrize("feedforward", ["none", "ctc", "id"])
def test_gain_is_on_the_torque_of_the_model_and_not_on_friction(robot, feedforward):
    gain = np.array([0.9, 1.1, 0.0, -1.0])
    plain = feedforward_torque(robot, feedforward)
    block = feedforward_torque(
        robot, feedforward, gain=gain, friction=lambda v: 300 * np.sign(v) + 20 * v
    )
    for reference in samples(10):
        v = reference[4:8]
        friction = (300 * np.sign(v) + 20 * v) / [67.2, 1, 1, 1]  # from the joints to the motors
        expected = gain * tau_ff(plain, reference) + friction
        np.testing.assert_allclose(tau_ff(block, reference), expected, rtol=1e-12, atol=1e-9)


def test_no_feedforward_is_zero(robot):
    for reference in samples(3):
        np.testing.assert_array_equal(tau_ff(feedforward_torque(robot, "none"), reference), 0)


@pytest.mark.parametrize("errors", [{"payload_mass": 100.0}, {"inertia_scale": 1.2}])
@pytest.mark.parametrize("feedforward", ["ctc", "id"])
def test_a_wrong_model_feeds_another_torque_forward(robot, feedforward, errors):
    model = deviated(robot, Deviation(**errors))
    right, wrong = (feedforward_torque(each, feedforward) for each in (robot, model))
    for reference in samples(5):
        assert not np.allclose(tau_ff(right, reference), tau_ff(wrong, reference), rtol=1e-3)


def test_links_heavier_by_a_factor_need_the_torque_of_the_links_times_that(robot):
    model = deviated(robot, Deviation(inertia_scale=1.2))
    right, wrong = (feedforward_torque(each, "ctc") for each in (robot, model))
    for reference in samples(5):
        np.testing.assert_allclose(
            tau_ff(wrong, reference), 1.2 * tau_ff(right, reference), rtol=1e-9, atol=1e-8
        )


@pytest.mark.parametrize("bad", [{"sign": "right"}, {"feedforward": "right"}])
def test_bad_choice_is_refused(robot, bad):
    if "sign" in bad:
        with pytest.raises(InputError, match="consistent, printed"):
            load_torque(robot, **bad)
        with pytest.raises(InputError, match="consistent, printed"):
            feedforward_torque(robot, "ctc", **bad)
    else:
        with pytest.raises(InputError, match="none, ctc, id"):
            feedforward_torque(robot, **bad)
