"""Inverse dynamics by torque groups, their decoupling into loads, and effective inertia."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import Context

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.io.shown import joint_count
from sdt_drake.robot.robot import Robot

# --- torque groups (Eq. 2) ------------------------------------------------------------------


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
    """The torque groups of one sample, as fields of `TorqueGroups`: inertial, reaction, velocity,
    gravity, d_kk.

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

    Raises:
        InputError: for a motion of another number of joints.
    """
    if q.shape[1] != robot.n:  # Drake would end the process
        raise InputError(
            f"{joint_count(q.shape[1])}, robot '{robot.name}' has {robot.n}",
            place="motion",
            kind="joints",
        )
    plant = robot.plant
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    torque = np.empty(q.shape)
    for i, q_and_v in enumerate(with_progress(np.hstack([q, v]))):
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
    rows = zip(
        with_progress(q_and_v.reshape(-1, 2 * robot.n)),
        vd.reshape(-1, robot.n),
        strict=True,
    )
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


# --- loads (Algorithm 1) --------------------------------------------------------------------

SIGNS = ("consistent", "printed")


class Loads(NamedTuple):
    """Coupling torques of each joint on its motor, **motor side**, shape (n,) or (N, n).

    Attributes:
        load_torque: tau_LD, what the motor must overcome [N m].
        alleviating_torque: tau_alleviate, help of the other motors towards the wanted
            acceleration, with its sign [N m].
    """

    load_torque: Array
    alleviating_torque: Array


def decouple(
    inertial: ArrayLike,
    coupled: ArrayLike,
    gear_ratio: ArrayLike,
    sign: str = "consistent",
) -> Loads:
    """Loads of the motors by Algorithm 1 of the paper, from the torque groups of the joints.

    The three branches are one expression. With own = d_kk vd_k, the help is that part of
    -tau_coupled which points along `own` and does not exceed it:

        r tau_alleviate = clip(-tau_coupled, min(own, 0), max(own, 0))
        r tau_LD        = tau_coupled + r tau_alleviate

    so tau_coupled = r (tau_LD - tau_alleviate) holds by construction. The paper prints the third
    branch (acceleration and coupling opposed, coupling the larger) as tau_LD = -tau_k / r, which
    breaks that identity by 2 tau_k; `sign="printed"` follows the print.

    Args:
        inertial: d_kk vd_k, joint side [N m], shape (n,) or (N, n).
        coupled: tau_coupled of Eq. 4, joint side [N m], same shape.
        gear_ratio: r, motor over joint speed [-], shape (n,).
        sign: "consistent" or "printed".
    """
    own, coupled = np.asarray(inertial, dtype=float), np.asarray(coupled, dtype=float)
    help_ = np.minimum(np.maximum(-coupled, np.minimum(own, 0.0)), np.maximum(own, 0.0))
    load = coupled + help_
    if sign == "printed":
        third = (np.sign(own) != np.sign(coupled)) & (np.abs(own) <= np.abs(coupled))
        load = np.where(third, -(own + coupled), load)
    return Loads(load / gear_ratio, help_ / gear_ratio)


# --- effective inertia (Eq. 3) --------------------------------------------------------------


def effective_inertia(robot: Robot, d_kk: ArrayLike) -> Array:
    """I_eff = I_m + d_kk / r² (Eq. 3), **motor side** [kg m²].

    Args:
        robot: gives the rotor inertias I_m and the gear ratios r.
        d_kk: diagonal of the links' mass matrix, joint side [kg m²], shape (n,) or (N, n).
    """
    return robot.rotor_inertia + np.asarray(d_kk) / robot.gear_ratio**2


def where_largest(d_kk: ArrayLike) -> NDArray[np.intp]:
    """First sample at which each joint's inertia is as large as it gets, round-off apart.

    Args:
        d_kk: diagonal of the links' mass matrix, joint side [kg m²], shape (N, n).

    Returns:
        Samples, shape (n,).
    """
    d_kk = np.asarray(d_kk)
    return np.argmax(d_kk >= (1 - 1e-9) * d_kk.max(axis=0), axis=0)


@dataclass(frozen=True, eq=False)
class InertiaRange:
    """How I_eff, motor side [kg m²], varies along a motion; each of shape (n,)."""

    maximum: Array
    median: Array
    minimum: Array

    @staticmethod
    def of(i_eff: Array) -> InertiaRange:
        """The range of I_eff of shape (N, n)."""
        return InertiaRange(
            maximum=np.max(i_eff, axis=0),
            median=np.median(i_eff, axis=0),
            minimum=np.min(i_eff, axis=0),
        )

    @property
    def variation_percent(self) -> Array:
        """(max - min) / max [%], as in Table 1. Round-off of a constant inertia is 0."""
        variation = 100 * (1 - self.minimum / self.maximum)
        return np.where(variation < 1e-9, 0.0, variation)
