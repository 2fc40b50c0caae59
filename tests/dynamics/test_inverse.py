"""Torque groups against Drake's inverse dynamics and a textbook arm; conservation of energy."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces
from test_robot import ARM, chain_sdf

from sdt_drake.dynamics import inverse_dynamics, torque_groups
from sdt_drake.robot import load_robot


@pytest.fixture(params=["shipped", "chain of 3 on a base", "chain of 7"])
def any_robot(request, robot, tmp_path):
    """The shipped device, and random chains with products of inertia and joint damping."""
    if request.param == "shipped":
        return robot
    path = tmp_path / "chain.sdf"
    path.write_text(chain_sdf(3, seed=5, base=True) if "3" in request.param else chain_sdf(7))
    return load_robot(path)


def random_states(robot, count: int):
    """q, v, vd [rad, rad/s, rad/s²] of shape (count, n)."""
    rng = np.random.default_rng(1)
    return rng.uniform([[[-3]], [[-2]], [[-5]]], [[[3]], [[2]], [[5]]], (3, count, robot.n))


def drake_torque(robot, q, v, vd):
    """Drake's inverse dynamics of one sample with all forces and the motors' inertia [N m]."""
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    return plant.CalcInverseDynamics(context, vd, forces)


def test_groups_sum_to_drakes_inverse_dynamics_without_the_motors(any_robot):
    q, v, vd = random_states(any_robot, 40)
    motors = any_robot.gear_ratio**2 * any_robot.rotor_inertia * vd
    expected = np.array([drake_torque(any_robot, *s) for s in zip(q, v, vd, strict=True)]) - motors
    groups = torque_groups(any_robot, q, v, vd)
    tolerance = 1e-9 * np.max(np.abs(expected), axis=0)
    assert np.all(np.abs(groups.total - expected) <= tolerance)
    whole = inverse_dynamics(any_robot, q, v, vd)
    assert np.all(np.abs(whole - groups.total - motors) <= tolerance)
    np.testing.assert_array_equal(groups.total, groups.inertial + groups.coupled)
    np.testing.assert_array_equal(
        groups.coupled, groups.reaction + groups.velocity + groups.gravity
    )


def test_each_group_has_its_own_cause(any_robot):
    q, v, vd = random_states(any_robot, 10)
    zero = np.zeros_like(q)
    full = torque_groups(any_robot, q, v, vd)
    at_rest = torque_groups(any_robot, q, zero, zero)
    for nothing in (at_rest.inertial, at_rest.reaction, at_rest.velocity):
        np.testing.assert_array_equal(nothing, zero)
    np.testing.assert_allclose(full.gravity, at_rest.gravity, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(full.inertial, full.d_kk * vd, rtol=1e-12)
    for k in range(any_robot.n):
        alone = torque_groups(any_robot, q, zero, vd * np.eye(any_robot.n)[k])
        np.testing.assert_array_equal(alone.reaction[:, k], 0)
        np.testing.assert_allclose(alone.inertial[:, k], full.inertial[:, k], rtol=1e-9)


def test_groups_of_a_planar_arm_are_those_of_the_textbook(tmp_path):
    (tmp_path / "arm.sdf").write_text(ARM)
    arm = load_robot(tmp_path / "arm.sdf")
    q, v, vd = random_states(arm, 20)
    groups = torque_groups(arm, q, v, vd)
    # Lengths, masses and inertias of ARM; positive angles lower the links.
    l1, c1, c2, m1, m2, I1, I2, damping, g = 0.8, 0.5, 0.3, 4, 2, 0.5, 0.2, 0.7, 9.81
    cos2, sin2 = np.cos(q[:, 1]), np.sin(q[:, 1])
    d11 = m1 * c1**2 + I1 + m2 * (l1**2 + c2**2 + 2 * l1 * c2 * cos2) + I2
    d12 = m2 * (c2**2 + l1 * c2 * cos2) + I2
    d22 = np.full_like(d11, m2 * c2**2 + I2)
    h = m2 * l1 * c2 * sin2
    lower = m2 * c2 * np.cos(q[:, 0] + q[:, 1])
    expected = {
        "d_kk": (d11, d22),
        "inertial": (d11 * vd[:, 0], d22 * vd[:, 1]),
        "reaction": (d12 * vd[:, 1], d12 * vd[:, 0]),
        "velocity": (
            -h * (2 * v[:, 0] * v[:, 1] + v[:, 1] ** 2) + damping * v[:, 0],
            h * v[:, 0] ** 2,
        ),
        "gravity": (-g * ((m1 * c1 + m2 * l1) * np.cos(q[:, 0]) + lower), -g * lower),
    }
    for name, columns in expected.items():
        np.testing.assert_allclose(
            getattr(groups, name), np.stack(columns, axis=1), rtol=1e-12, atol=1e-12, err_msg=name
        )


def test_a_sample_is_a_row_of_the_motion(any_robot):
    q, v, vd = random_states(any_robot, 5)
    motion = torque_groups(any_robot, q, v, vd)
    for i in range(5):
        sample = torque_groups(any_robot, q[i].tolist(), v[i], vd[i])
        for name in ("inertial", "reaction", "velocity", "gravity", "d_kk", "coupled", "total"):
            np.testing.assert_array_equal(getattr(sample, name), getattr(motion, name)[i])
