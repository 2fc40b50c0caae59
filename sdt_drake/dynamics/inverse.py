"""The torque of each joint, split into the four groups of Eq. 2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import Context

from sdt_drake.arrays import Array
from sdt_drake.progress import told_alone
from sdt_drake.robot import Robot


@dataclass(frozen=True, eq=False)
class TorqueGroups:
    """Joint torques by cause (Eq. 2): **link side**, so without the inertia of the motors.

    All arrays have the shape of the motion, (n,) for a sample or (N, n); joint side.

    Attributes:
        inertial: d_kk vd_k [N m].
        reaction: sum over j != k of d_kj vd_j, from the accelerations of other joints [N m].
        velocity: centrifugal and Coriolis terms, and viscous friction if the SDF has any [N m].
        gravity: torque that holds the links against gravity [N m].
        d_kk: diagonal of the mass matrix of the links [kg m²].
    """

    inertial: Array
    reaction: Array
    velocity: Array
    gravity: Array
    d_kk: Array

    @property
    def coupled(self) -> Array:
        """tau_coupled: all but the inertial group (Eq. 4) [N m]."""
        return self.reaction + self.velocity + self.gravity

    @property
    def total(self) -> Array:
        """tau of Eq. 2: the sum of the four groups [N m]."""
        return self.inertial + self.coupled


def groups_of_sample(
    robot: Robot, context: Context, q_and_v: Array, vd: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """The fields of `TorqueGroups` for one sample: inertial, reaction, velocity, gravity, d_kk.

    `context` is scratch of `robot.plant`; q_and_v is [q, v] [rad, rad/s], shape (2n,), and vd
    [rad/s²] has shape (n,). Nothing is checked here: this is the inner loop of a motion and of the
    on-line block.
    """
    plant = robot.plant
    plant.SetPositionsAndVelocities(context, q_and_v)
    M = plant.CalcMassMatrix(context)
    d_kk = M.diagonal() - robot.reflected_inertia
    inertial = d_kk * vd
    reaction = M @ vd - M.diagonal() * vd
    velocity = plant.CalcBiasTerm(context) + robot.damping * q_and_v[robot.n :]
    gravity = -plant.CalcGravityGeneralizedForces(context)
    return inertial, reaction, velocity, gravity, d_kk


def inverse_dynamics(robot: Robot, q: Array, v: Array, vd: Array) -> Array:
    """Joint torque **with the inertia of the motors**, joint side [N m], shape (N, n).

    It is the total of `torque_groups` and r² I_m vd, by Drake's recursion, which is faster.

    Args:
        robot: the robot.
        q, v, vd: joint positions [rad], speeds [rad/s] and accelerations [rad/s²], shape (N, n).
    """
    plant = robot.plant
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    torque = np.empty(q.shape)
    for i, q_and_v in enumerate(told_alone(np.hstack([q, v]))):
        plant.SetPositionsAndVelocities(context, q_and_v)
        plant.CalcForceElementsContribution(context, forces)  # gravity and viscous friction
        torque[i] = plant.CalcInverseDynamics(context, vd[i], forces)
    return torque


def torque_groups(robot: Robot, q: ArrayLike, v: ArrayLike, vd: ArrayLike) -> TorqueGroups:
    """Inverse dynamics of the links by groups (Eq. 2), for a sample or a whole motion.

    Args:
        robot: the robot.
        q, v, vd: joint positions [rad], speeds [rad/s] and accelerations [rad/s²], all of shape
            (n,) or all of shape (N, n).
    """
    q_and_v, vd = np.concatenate([q, v], axis=-1), np.asarray(vd, dtype=float)
    context = robot.plant.CreateDefaultContext()
    rows = zip(told_alone(q_and_v.reshape(-1, 2 * robot.n)), vd.reshape(-1, robot.n), strict=True)
    groups = np.array([groups_of_sample(robot, context, *row) for row in rows])
    return TorqueGroups(*np.moveaxis(groups.reshape(*vd.shape[:-1], 5, robot.n), -2, 0))


def gravity_stiffness(robot: Robot, q: Array) -> Array:
    """Change of the joints' gravity torques with their angles, joint side [N m/rad], (n, n).

    Entry (j, k) is that of joint j with the angle of joint k; q [rad] has shape (n,).
    """
    step = 1e-5  # rad
    turned = step * np.eye(robot.n)
    around = q + np.vstack([-turned, turned])  # a row for each joint, turned back and on
    rest = np.zeros_like(around)
    low, high = np.split(torque_groups(robot, around, rest, rest).gravity, 2)
    return (high - low).T / (2 * step)
