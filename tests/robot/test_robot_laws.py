"""Laws that hold for every robot: dynamics, sides of the gears, Algorithm 1, head, deviations."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces
from strategies import GENERATORS, moving, robots

from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.dynamics import decouple, effective_inertia, inverse_dynamics, torque_groups
from sdt_drake.robot.head import head_motion
from sdt_drake.robot.robot import edited, load_robot, parts_of

NO_SHRINKING = (Phase.explicit, Phase.generate)  # a seed has no simpler one
FEW = settings(max_examples=10, phases=NO_SHRINKING)
MANY = settings(max_examples=30, phases=NO_SHRINKING)


def drake_torque(robot, q, v, vd):
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    return plant.CalcInverseDynamics(context, vd, forces)


def pinocchio_torque(robot, q, v, vd):
    """Of the links alone, without friction."""
    pin = pytest.importorskip("pinocchio")
    model, parent = pin.Model(), 0
    for name in robot.joint_names:
        joint = robot.plant.GetJointByName(name)
        pose = joint.frame_on_parent().GetFixedPoseInBodyFrame()
        place = pin.SE3(pose.rotation().matrix(), pose.translation())
        turning = pin.JointModelRevoluteUnaligned(joint.revolute_axis())
        parent = model.addJoint(parent, turning, place, name)
        body = pin.Inertia(*parts_of(joint.child_body()))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    return pin.rnea(model, model.createData(), q, v, vd)


@MANY
@given(moving())
@example((load_robot(), *np.random.default_rng(1).uniform(-3, 3, (3, 5, 4))))
def test_torque_groups_add_up_to_drakes_inverse_dynamics(case):
    robot, q, v, vd = case
    groups = torque_groups(robot, q, v, vd)
    motors = robot.reflected_inertia * vd
    for i in range(len(q)):
        expected = drake_torque(robot, q[i], v[i], vd[i])
        close = {"rtol": 0, "atol": 1e-9 * np.abs(expected).max() + 1e-12}
        np.testing.assert_allclose(groups.total[i] + motors[i], expected, **close)
        sample = torque_groups(robot, q[i].tolist(), v[i], vd[i])
        np.testing.assert_array_equal(sample.total, groups.total[i])
    whole = inverse_dynamics(robot, q, v, vd)
    np.testing.assert_allclose(whole, groups.total + motors, rtol=1e-9, atol=1e-8)


@MANY
@given(moving())
def test_torque_groups_add_up_to_pinocchios_inverse_dynamics(case):
    robot, total = case[0], torque_groups(*case).total
    for q, v, vd, torque in zip(*case[1:], total, strict=True):
        links = pinocchio_torque(robot, q, v, vd) + robot.damping * v
        np.testing.assert_allclose(torque, links, rtol=1e-8, atol=1e-8)


@FEW
@given(moving())
def test_each_torque_group_has_its_own_cause(case):
    robot, q, _, vd = case
    zero, full = np.zeros_like(q), torque_groups(*case)
    rest = torque_groups(robot, q, zero, zero)
    np.testing.assert_array_equal([rest.inertial, rest.reaction, rest.velocity], 0)
    np.testing.assert_allclose(full.gravity, rest.gravity, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(full.inertial, full.d_kk * vd, rtol=1e-12)
    for k, unit in enumerate(np.eye(robot.n)):
        alone = torque_groups(robot, q, zero, vd * unit)
        np.testing.assert_array_equal(alone.reaction[:, k], 0)
        np.testing.assert_allclose(alone.inertial[:, k], full.inertial[:, k], rtol=1e-9)


@FEW
@given(moving())
def test_power_of_the_torques_is_the_change_of_the_energy_and_the_loss(case):
    robot, q, v, vd = case
    plant, context, h = robot.plant, robot.plant.CreateDefaultContext(), 1e-4

    def energy(q, v):
        plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
        return plant.CalcKineticEnergy(context) + plant.CalcPotentialEnergy(context)

    torque = inverse_dynamics(robot, q, v, vd)
    for i in range(len(q)):
        after, before = (
            energy(q[i] + s * v[i] + s * s * vd[i] / 2, v[i] + s * vd[i]) for s in (h, -h)
        )
        power, scale = torque[i] @ v[i], np.abs(torque[i]) @ np.abs(v[i])
        found = (after - before) / (2 * h) + robot.damping @ v[i] ** 2
        assert found == pytest.approx(power, abs=1e-4 * scale)


@MANY
@given(robots(coupled=True), GENERATORS)
def test_sides_of_the_gears(robot, rng):
    """Speeds by the coupling, torques by the same power."""
    v, torque = rng.normal(size=(2, 4, robot.n))
    motors = robot.of_motors(v)
    np.testing.assert_allclose(robot.of_joints(motors), v, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(robot.motor_torque(robot.joint_torque(torque)), torque, rtol=1e-6)
    power = np.sum(torque * motors, axis=1)
    np.testing.assert_allclose(np.sum(robot.joint_torque(torque) * v, axis=1), power, rtol=1e-9)
    np.testing.assert_allclose(motors[:, 0], robot.gear_ratio[0] * v[:, 0])
    assert robot.is_coupled == (robot.n > 1) == bool(robot.accepted)
    r, d_kk = robot.gear_ratio, np.abs(v)
    np.testing.assert_allclose(robot.motor_torque_limit * r, robot.effort_limit)
    i_eff = effective_inertia(robot, d_kk)
    np.testing.assert_allclose(r**2 * i_eff, d_kk + r**2 * robot.rotor_inertia)
    np.testing.assert_allclose(robot.reflected_inertia, r**2 * robot.rotor_inertia)


def algorithm_1(own, tau_coupled, r, sign):
    """Algorithm 1 of the paper, line by line: tau_LD and tau_alleviate."""
    tau_k = own + tau_coupled  # Eq. 4
    if np.sign(own) == np.sign(tau_coupled):
        return tau_coupled / r, 0.0
    if abs(own) > abs(tau_coupled):
        return 0.0, -tau_coupled / r
    return {"printed": -tau_k, "consistent": tau_k}[sign] / r, (tau_k - tau_coupled) / r


TORQUES = st.integers(-4, 4) | st.floats(-1e4, 1e4)


@settings(max_examples=150)
@given(TORQUES, TORQUES, st.sampled_from([0.5, 1, 67.2]))
def test_loads_follow_algorithm_1(own, coupled, r):
    for sign in ("printed", "consistent"):
        loads = decouple([own], [coupled], [r], sign)
        assert np.ravel(loads) == pytest.approx(algorithm_1(own, coupled, r, sign), abs=1e-12)
    # The motor and the others together bear the coupling; help is no more than is needed.
    (load,), (help_,) = loads
    assert r * (load - help_) == pytest.approx(coupled, rel=1e-12, abs=1e-12)
    assert help_ * own >= 0 and abs(r * help_) <= abs(own) + 1e-12


def check_head(robot, q, v, vd):
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    head, world = plant.GetFrameByName("head"), plant.world_frame()
    motion = head_motion(robot, q, v, vd)
    at_head = (context, JacobianWrtVariable.kV, head, np.zeros(3), world, world)
    for i in range(len(q)):
        plant.SetPositionsAndVelocities(context, np.concatenate([q[i], v[i]]))
        pose = head.CalcPoseInWorld(context)
        R = pose.rotation().matrix()
        bias = plant.CalcBiasSpatialAcceleration(*at_head).get_coeffs()
        acceleration = plant.CalcJacobianSpatialVelocity(*at_head) @ vd[i] + bias
        gravity = plant.gravity_field().gravity_vector()
        expected = {
            "specific_force": R.T @ (acceleration[3:] - gravity),
            "angular_velocity": head.CalcSpatialVelocity(context, world, head).rotational(),
            "angular_acceleration": R.T @ acceleration[:3],
            "position": pose.translation(),
            "rotation": R,
        }
        for name, value in expected.items():
            own = getattr(motion, name)[i]
            np.testing.assert_allclose(own, value, rtol=1e-9, atol=1e-8, err_msg=name)


@FEW
@given(moving(head=True))
def test_the_head_moves_as_in_drake(case):
    check_head(*case)


def test_a_head_on_a_link_below_moves_as_in_drake():
    def edit(root):
        root.find(".//frame[@name='head']").set("attached_to", "arm")

    check_head(edited(load_robot(), edit), *np.random.default_rng(1).uniform(-3, 3, (3, 5, 4)))


@FEW
@given(robots(), st.data())
def test_every_link_is_as_the_deviation_says_and_nothing_else_changes(robot, data):
    rng, links = data.draw(GENERATORS), [f"link_{k + 1}" for k in range(robot.n)]
    names = re.findall('<link name="(.*?)"', robot.sdf)
    payload, scales = data.draw(st.sampled_from(links)), rng.uniform(0.5, 2, len(names))
    added, offset, scale = rng.uniform(-3, 3), rng.normal(size=3) / 10, rng.uniform(0.5, 2)
    deviation = Deviation(payload, added, list(offset), scale, link_scales=list(scales))
    model = deviated(robot, deviation)
    for name, own in zip(names, scales, strict=True):
        m, com, central = parts_of(robot.plant.GetBodyByName(name))
        factor = scale * own
        if name == payload:  # the same body, evenly heavier, at another place
            factor, com = factor * (m + added) / m, com + offset
        mass, moved, inertia = parts_of(model.plant.GetBodyByName(name))
        assert mass == pytest.approx(factor * m, rel=1e-12)
        np.testing.assert_allclose(moved, com, atol=1e-12)
        np.testing.assert_allclose(inertia, factor * central, rtol=1e-9, atol=1e-10)
    check_same_but_inertia(model, robot)
    assert deviated(robot, Deviation()) is robot and deviated(robot, deviation) is model


FIELDS = ("joint_names", "rotor_inertia", "gear_ratio", "coupling", "effort_limit", "damping")
FIELDS += ("velocity_limit", "acceleration_limit", "position_lower", "position_upper", "accepted")


def check_same_but_inertia(model, robot):
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(model, name), getattr(robot, name), err_msg=name)
    for plant in (model.plant, robot.plant):
        found = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
        assert tuple(a.joint().name() for a in found) == robot.joint_names
        rotors = [a.default_rotor_inertia() for a in found]
        np.testing.assert_array_equal(rotors, robot.rotor_inertia)


@FEW
@given(robots(coupled=True))
def test_the_text_of_a_robot_is_that_robot(robot):
    same = edited(robot, lambda root: None)
    check_same_but_inertia(same, robot)
    assert same is not robot and same.sdf == robot.sdf
