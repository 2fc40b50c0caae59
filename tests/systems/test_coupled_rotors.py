"""Rotors that turn with two joints, in simulation: accelerations, energy, control, springs."""

import numpy as np
import pytest
from helpers.robots import WRIST, loaded
from helpers.strategies import GENERATORS, moving
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.systems.framework import InputPortIndex, OutputPortIndex
from pydrake.systems.primitives import FirstOrderTaylorApproximation

from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.robot.device import Elasticity, Springs
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.run.controllers import Pi
from sdt_drake.run.plant import springs_along
from sdt_drake.run.scenario import PlantChoice, Scenario
from sdt_drake.run.simulate import make_simulator
from sdt_drake.systems import elastic_joints, inverse_dynamics_controller, robot_plant
from sdt_drake.systems.elastic_joints import set_motor_state
from sdt_drake.systems.wiring import set_state

C, ROTORS = np.array([[10.0, 0.0], [-30.0, 40.0]]), np.array([0.01, 4e-4])


def accelerated(process, q, v, tau, load):
    context = process.CreateDefaultContext()
    for name, torque in (("tau", tau), ("load_torque", load)):
        process.GetInputPort(name).FixValue(context, torque)
    set_state(process, context, "multibody_plant", [*q, *v])
    return process.EvalTimeDerivatives(context).CopyToVector()[len(q) :], context


@settings(max_examples=20)
@given(moving(1, joints=st.integers(2, 6), coupled=True), GENERATORS)
def test_plant_acceleration_inverts_inverse_dynamics(case, rng):
    """They are Pinocchio's, with C' I_m C. The linear model has the same mass matrix."""
    robot, (q,), (v,), _ = case
    tau, load = rng.normal(size=(2, robot.n)) * robot.motor_torque_limit / 10
    process = robot_plant(robot=robot)
    vd, context = accelerated(process, q, v, tau, load)
    torque = inverse_dynamics(robot, q[None], v[None], vd[None])[0]
    expected = robot.gear_ratio * (tau - load)
    parts = np.abs(robot.mass_matrix(robot.context_at_zero())) @ np.abs(vd)
    np.testing.assert_allclose(torque, expected, atol=1e-9 * max(parts.max(), 1))
    ports = InputPortIndex(process.GetInputPort("tau").get_index()), OutputPortIndex(0)
    B = FirstOrderTaylorApproximation(process, context, *ports).B()[robot.n :]
    at = robot.plant.CreateDefaultContext()
    robot.plant.SetPositions(at, q)
    wanted = np.diag(robot.gear_ratio)
    np.testing.assert_allclose(robot.mass_matrix(at) @ B, wanted, atol=1e-7 * wanted.max())


def test_rotors_apart_leave_the_plant_of_the_links():
    links = loaded(WRIST.replace("inertia>0.01", "inertia>0").replace("inertia>4e-4", "inertia>0"))
    q, v, tau, load = np.array([[0.3, -0.5], [1.0, -2.0], [0.4, 0.2], [0.1, -0.3]])
    apart = robot_plant(robot=loaded(WRIST), without_rotor=np.array([True, True]))
    found, expected = (
        accelerated(x, q, v, tau, load)[0] for x in (apart, robot_plant(robot=links))
    )
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_coupled_rotors_keep_energy():
    wrist = loaded(WRIST)
    process = robot_plant(robot=wrist)
    simulator = make_simulator(process, period=0.001, accuracy=1e-8)
    root = simulator.get_mutable_context()
    for name in ("tau", "load_torque"):
        process.GetInputPort(name).FixValue(root, np.zeros(2))
    set_state(process, root, "multibody_plant", [0.4, 1.2, 1.0, -2.0])
    plant, seen = process.GetSubsystemByName("multibody_plant"), []
    inner = plant.GetMyContextFromRoot(root)
    for time in np.linspace(0, 1, 51):
        simulator.AdvanceTo(time)
        v = plant.GetVelocities(inner)
        links = plant.CalcMassMatrix(inner) - np.diag(np.diag(C.T * ROTORS @ C))
        motors = C @ v
        moving_parts = v @ links @ v / 2, motors @ (ROTORS * motors) / 2
        seen.append([*moving_parts, plant.CalcPotentialEnergy(inner)])
    swings = np.ptp(np.array(seen), axis=0)
    assert np.all(swings > 1), swings
    assert np.ptp(np.sum(seen, axis=1)) < 1e-5 * swings.min()


@settings(max_examples=10)
@given(moving(2, joints=st.integers(2, 4), coupled=True))
def test_computed_torque_decouples_coupled_rotors(case):
    robot, q, v, vd = case
    omega_n, zeta = np.arange(2.0, 2 + robot.n), np.linspace(0.5, 1, robot.n)
    law = inverse_dynamics_controller(model=robot, omega_n=omega_n, zeta=zeta)
    context = law.CreateDefaultContext()
    reference = np.concatenate([q[0], v[0], vd[0]])
    law.GetInputPort("reference").FixValue(context, reference)
    law.GetInputPort("sampled_state").FixValue(context, np.concatenate([q[1], v[1]]))
    tau = law.GetOutputPort("tau_fb").Eval(context)
    found, _ = accelerated(robot_plant(robot=robot), q[1], v[1], tau, np.zeros(robot.n))
    asked = vd[0] + 2 * zeta * omega_n * (v[0] - v[1]) + omega_n**2 * (q[0] - q[1])
    np.testing.assert_allclose(found, asked, rtol=1e-6, atol=1e-6 * np.abs(asked).max())


def test_coupled_rotors_behind_springs_turn_together():
    """C' I_m C wd = r tau - k (theta - q), with both joints elastic."""
    wrist, springs = loaded(WRIST), Springs(np.ones(2, bool), np.array([2e3, 9e2]), np.zeros(2))
    rotors = {"rotor_inertia": wrist.motor_inertia, "shared_inertia": wrist.shared_inertia}
    joints = elastic_joints(springs=springs, gear_ratio=[10, 40], **rotors)
    context, tau, state = joints.CreateDefaultContext(), np.array([2.0, -0.3]), np.zeros(4)
    set_motor_state(joints, context, [0.01, -0.02], [0.5, 0.7], springs=springs)
    joints.GetInputPort("tau").FixValue(context, tau)
    joints.GetInputPort("state").FixValue(context, state)
    wd = joints.EvalTimeDerivatives(context).CopyToVector()[2:]
    wound = [2e3 * 0.01, -9e2 * 0.02]
    np.testing.assert_allclose((C.T * ROTORS @ C) @ wd, [10, 40] * tau - wound, atol=1e-9)


def test_coupled_motor_between_elastic_and_rigid_joint_is_refused():
    plant = PlantChoice("coupled", elasticity=Elasticity(natural_frequency=[60.0, 0.0]))
    scenario = Scenario(plant=plant, controller=Pi(omega_r=60.0))
    wrist, still = loaded(WRIST), Motion(0.005, *np.zeros((3, 3, 2)))
    with pytest.raises(InputError, match="joint 1 is elastic and joint 2 rigid, but a motor turns"):
        springs_along(scenario, wrist, still)
