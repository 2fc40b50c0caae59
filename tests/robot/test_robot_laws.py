"""Laws that hold for every robot: dynamics, sides of the gears, Algorithm 1, deviations."""

import dataclasses
import re

import numpy as np
import pytest
from helpers.strategies import GENERATORS, moving, robots
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from oracles.pinocchio_model import pinocchio_torque

from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.dynamics import decouple, effective_inertia, inverse_dynamics, torque_groups
from sdt_drake.robot.parsed import parts_of
from sdt_drake.robot.robot import Robot, edited, load_robot

NO_SHRINKING = (Phase.explicit, Phase.generate)  # a seed has no simpler one
FEW = settings(max_examples=10, phases=NO_SHRINKING)
MANY = settings(max_examples=30, phases=NO_SHRINKING)


@MANY
@given(st.booleans().flatmap(lambda coupled: moving(coupled=coupled)))
@example((load_robot(), *np.random.default_rng(1).uniform(-3, 3, (3, 5, 4))))
def test_torque_groups_add_up_to_pinocchios_inverse_dynamics(case):
    robot, q, v, vd = case
    groups = torque_groups(robot, q, v, vd)
    links = np.array([pinocchio_torque(robot, *sample) for sample in zip(q, v, vd, strict=True)])
    # Rotors turn at C v: their energy is (C v)' I_m (C v) / 2, their torque C' I_m C vd.
    rotors = (vd @ robot.coupling.T * robot.rotor_inertia) @ robot.coupling
    whole = links + rotors + robot.damping * v
    close = {"rtol": 0, "atol": 1e-9 * np.abs(whole).max() + 1e-9}
    np.testing.assert_allclose(inverse_dynamics(robot, q, v, vd), whole, **close)
    own = robot.reflected_inertia * vd  # all rotors that turn with a joint, by this joint alone
    np.testing.assert_allclose(groups.total + own, whole, **close)
    for i in range(len(q)):
        sample = torque_groups(robot, q[i].tolist(), v[i], vd[i])
        np.testing.assert_array_equal(sample.total, groups.total[i])


@MANY
@given(robots(coupled=True), GENERATORS)
def test_motor_and_joint_sides_convert_both_ways_with_equal_power(robot, rng):
    """Speeds by the coupling, torques by the same power."""
    v, torque = rng.normal(size=(2, 4, robot.n))
    motors, joints = robot.of_motors(v), robot.joint_torque(torque)
    np.testing.assert_allclose(robot.of_joints(motors), v, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(robot.motor_torque(joints), torque, rtol=1e-6)
    np.testing.assert_allclose(np.sum(joints * v, 1), np.sum(torque * motors, 1), rtol=1e-9)
    np.testing.assert_allclose(motors[:, 0], robot.gear_ratio[0] * v[:, 0])
    assert robot.is_coupled == (robot.n > 1) == bool(robot.accepted)
    r, reflected = robot.gear_ratio, robot.reflected_inertia
    np.testing.assert_allclose(robot.motor_torque_limit * r, robot.effort_limit)
    np.testing.assert_allclose(robot.gear_speed(v), motors / r)
    np.testing.assert_allclose(robot.gear_torque(joints), torque * r, rtol=1e-6)
    whole = robot.coupling.T @ np.diag(robot.rotor_inertia) @ robot.coupling
    np.testing.assert_allclose(np.diag(reflected) + robot.shared_inertia, whole, atol=1e-12)
    np.testing.assert_allclose(r**2 * effective_inertia(robot, v**2), v**2 + reflected)


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


@FEW
@given(robots(), st.data())
def test_deviation_scales_its_links_and_leaves_the_others(robot, data):
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


def check_same_but_inertia(model, robot):
    for name in {field.name for field in dataclasses.fields(Robot)} - {"plant", "sdf"}:
        np.testing.assert_array_equal(getattr(model, name), getattr(robot, name), err_msg=name)


@FEW
@given(robots(coupled=True))
def test_saved_robot_loads_as_the_same_robot(robot):
    same = edited(robot, lambda root: None)
    check_same_but_inertia(same, robot)
    assert same is not robot and same.sdf == robot.sdf
    plant = same.plant  # its actuators are in the order of the joints
    motors = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    assert [motor.joint().name() for motor in motors] == [*robot.joint_names]
    assert [motor.default_rotor_inertia() for motor in motors] == [*robot.motor_inertia]
