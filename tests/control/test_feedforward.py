"""The torque feedforward against Drake's inverse dynamics."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces

from sdt_drake.control import FEEDFORWARDS, feedforward_torque
from sdt_drake.dynamics import torque_groups
from sdt_drake.errors import InputError

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


def test_rotors_are_in_id_and_no_more(robot):
    """Of the motor's own acceleration r vd."""
    groups = np.zeros((4, *VD.shape))
    tau_ff = feedforward_torque("id", robot, groups, VD, "consistent")
    np.testing.assert_allclose(tau_ff, ROTORS * R * VD, rtol=1e-14)


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


def test_ctc_does_not_see_the_rotors(robot):
    groups = groups_of(robot, Q, V, VD)
    first, second = (
        feedforward_torque("ctc", robot, groups, vd, "consistent") for vd in (VD, 7 * VD)
    )
    np.testing.assert_array_equal(first, second)


def test_id_does_not_ask_for_the_sign(robot):
    groups = groups_of(robot, Q, V, VD)
    first, second = (
        feedforward_torque("id", robot, groups, VD, sign) for sign in ("consistent", "printed")
    )
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("rows", [0, slice(None)])
def test_none_is_zero(robot, rows):
    motion = Q[rows], V[rows], VD[rows]
    tau_ff = feedforward_torque("none", robot, groups_of(robot, *motion), VD[rows], "consistent")
    np.testing.assert_array_equal(tau_ff, np.zeros(Q[rows].shape))


@pytest.mark.parametrize("feedforward", FEEDFORWARDS)
def test_a_sample_or_a_whole_motion(robot, feedforward):
    whole = feedforward_torque(feedforward, robot, groups_of(robot, Q, V, VD), VD, "consistent")
    for i in range(3):
        sample = groups_of(robot, Q[i], V[i], VD[i])
        one = feedforward_torque(feedforward, robot, sample, VD[i], "consistent")
        np.testing.assert_allclose(one, whole[i], rtol=1e-12, atol=1e-12)


def test_bad_words_are_refused(robot):
    groups = np.zeros((4, 4))
    with pytest.raises(InputError, match=r"^feedforward: 'full', expected one of none, ctc, id$"):
        feedforward_torque("full", robot, groups, np.zeros(4), "consistent")
    with pytest.raises(InputError, match=r"^sign of Algorithm 1: 'none', expected one of consis"):
        feedforward_torque("ctc", robot, groups, np.zeros(4), "none")
