"""The torque feedforward against Drake's inverse dynamics."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces

from sdt_drake.control import feedforward_torque
from sdt_drake.dynamics import torque_groups

R = np.array([67.2, 1, 1, 1])
ROTORS = np.array([0.1291, 1.73, 0.531, 0.531])  # kg m², motor side
SIZES = (np.pi, 2.0, 3.0)  # of q, v, vd
RNG = np.random.default_rng(5)
Q, V, VD = (RNG.uniform(-size, size, size=(40, 4)) for size in SIZES)


def groups_of(robot, *motion):
    groups = torque_groups(robot, *motion)
    return groups.inertial, groups.reaction, groups.velocity, groups.gravity


def test_id_is_drakes_inverse_dynamics_over_the_gear_ratio(robot):
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    expected = np.empty_like(Q)
    for i, (q, v, vd) in enumerate(zip(Q, V, VD, strict=True)):
        plant.SetPositionsAndVelocities(context, [*q, *v])
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)  # gravity
        expected[i] = plant.CalcInverseDynamics(context, vd, forces) / R
    tau_ff = feedforward_torque("id", robot, groups_of(robot, Q, V, VD), VD, "consistent")
    np.testing.assert_allclose(tau_ff, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("sign", ["consistent", "printed"])
def test_ctc_is_algorithm_1(robot, sign):
    """The three branches one by one, as the paper prints them."""
    inertial, *coupling = groups_of(robot, Q, V, VD)
    coupled = sum(coupling)
    expected, third = np.empty_like(Q), 0
    for i, k in np.ndindex(*Q.shape):
        own, other = inertial[i, k], coupled[i, k]
        if own * other >= 0:
            load = other
        elif abs(own) > abs(other):
            load = 0.0
        else:
            third += 1
            load = own + other if sign == "consistent" else -(own + other)
        expected[i, k] = load / R[k]
    assert third > 10
    tau_ff = feedforward_torque("ctc", robot, groups_of(robot, Q, V, VD), VD, sign)
    np.testing.assert_allclose(tau_ff, expected, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("rows", [0, slice(None)])
def test_none_is_zero(robot, rows):
    motion = Q[rows], V[rows], VD[rows]
    tau_ff = feedforward_torque("none", robot, groups_of(robot, *motion), VD[rows], "consistent")
    np.testing.assert_array_equal(tau_ff, np.zeros(Q[rows].shape))
