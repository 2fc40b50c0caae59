"""Inverse dynamics by torque groups, decoupling into motor loads, and effective inertia."""

from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import Context

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import joint_count
from sdt_drake.robot.lacks import MASSES
from sdt_drake.robot.robot import Robot

# --- torque groups (Eq. 2) ------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class TorqueGroups:
    """Joint torques by cause (Eq. 2), joint side, without the inertia of a joint's own motors.

    The missing torque is `Robot.reflected_inertia` times vd. A motor that turns with two joints is
    also accelerated by the other one; this is part of the reaction. All arrays have the shape of
    the motion, (n,) for a sample or (N, n).
    """

    inertial: Array
    """d_kk vd_k [N m]."""
    reaction: Array
    """Torque from accelerations of other joints: sum over j != k of m_kj vd_j [N m]."""
    velocity: Array
    """Centrifugal and Coriolis torque, and viscous friction of the file [N m]."""
    gravity: Array
    """Torque that holds the links against gravity [N m]."""
    d_kk: Array
    """Diagonal of the links' mass matrix [kg m²]."""

    @property
    def coupled(self) -> Array:
        """tau_coupled, the sum of all groups except the inertial one (Eq. 4) [N m]."""
        return self.reaction + self.velocity + self.gravity

    @property
    def total(self) -> Array:
        """tau of Eq. 2, the sum of the four groups [N m]."""
        return self.inertial + self.coupled


def groups_of_sample(
    robot: Robot, context: Context, q_and_v: Array, vd: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """Compute the torque groups of one sample, without checks: this is an inner loop.

    Args:
        robot: the robot.
        context: a context of `robot.plant`, overwritten.
        q_and_v: joint positions [rad] and speeds [rad/s], shape (2n,).
        vd: joint accelerations [rad/s²], shape (n,).

    Returns:
        inertial, reaction, velocity, gravity, d_kk, as in `TorqueGroups`.
    """
    plant = robot.plant
    plant.SetPositionsAndVelocities(context, q_and_v)
    M = robot.mass_matrix(context)
    d_kk = M.diagonal() - robot.reflected_inertia
    inertial = d_kk * vd
    reaction = M @ vd - M.diagonal() * vd
    velocity = plant.CalcBiasTerm(context) + robot.damping * q_and_v[robot.n :]
    gravity = -plant.CalcGravityGeneralizedForces(context)
    return inertial, reaction, velocity, gravity, d_kk


def inverse_dynamics(robot: Robot, q: Array, v: Array, vd: Array) -> Array:
    """Compute the joint torque **with the motors' inertia**, joint side [N m], shape (N, n).

    The result is the total of `torque_groups` plus `Robot.reflected_inertia` times vd. Drake's
    recursion is faster.

    Args:
        robot: the robot.
        q: joint positions [rad], shape (N, n).
        v: joint speeds [rad/s], shape (N, n).
        vd: joint accelerations [rad/s²], shape (N, n).

    Raises:
        InputError: the motion has another number of joints, or links have no mass.
    """
    if q.shape[1] != robot.n:  # otherwise Drake would abort the process
        raise InputError(
            f"{joint_count(q.shape[1])}, robot '{robot.name}' has {robot.n}",
            place="motion",
            kind="joints",
        )
    plant = robot.having(MASSES).plant
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    torque = np.empty(q.shape)
    for i, q_and_v in enumerate(np.hstack([q, v])):
        plant.SetPositionsAndVelocities(context, q_and_v)
        plant.CalcForceElementsContribution(context, forces)  # gravity and viscous friction
        torque[i] = plant.CalcInverseDynamics(context, vd[i], forces)
    return torque + vd @ robot.shared_inertia


def torque_groups(robot: Robot, q: ArrayLike, v: ArrayLike, vd: ArrayLike) -> TorqueGroups:
    """Compute the links' inverse dynamics by torque groups (Eq. 2), for a sample or a motion.

    >>> from sdt_drake.robot.robot import load_robot
    >>> groups = torque_groups(load_robot(), [0, 0.5, 0, 0], [0, 0, 0, 0], [0.1, 0, 0, 0])
    >>> groups.inertial.round(1)
    array([1721.4,    0. ,    0. ,    0. ])

    Args:
        robot: the robot.
        q: joint positions [rad], shape (n,) or (N, n).
        v: joint speeds [rad/s], same shape.
        vd: joint accelerations [rad/s²], same shape.

    Raises:
        InputError: links without mass.
    """
    q_and_v, vd = np.concatenate([q, v], axis=-1), np.asarray(vd, dtype=float)
    context = robot.having(MASSES).plant.CreateDefaultContext()
    rows = zip(q_and_v.reshape(-1, 2 * robot.n), vd.reshape(-1, robot.n), strict=True)
    groups = np.array([groups_of_sample(robot, context, *row) for row in rows])
    return TorqueGroups(*np.moveaxis(groups.reshape(*vd.shape[:-1], 5, robot.n), -2, 0))


def gravity_stiffness(robot: Robot, q: Array) -> Array:
    """Compute the derivative of the gravity torques with respect to the joint positions.

    Args:
        robot: the robot.
        q: joint positions [rad], shape (n,).

    Returns:
        Entry (j, k) is the change of joint j's torque with joint k's position, joint side
        [N m/rad], shape (n, n).
    """
    step = 1e-5  # rad
    turned = step * np.eye(robot.n)
    around = q + np.vstack([-turned, turned])  # one row per joint, turned back and forth
    rest = np.zeros_like(around)
    low, high = np.split(torque_groups(robot, around, rest, rest).gravity, 2)
    return (high - low).T / (2 * step)


# --- loads (Algorithm 1) --------------------------------------------------------------------

Sign = Literal["consistent", "printed"]
SIGNS: tuple[Sign, ...] = get_args(Sign)


class Loads(NamedTuple):
    """Coupling torques of each joint on its motor, **motor side**, shape (n,) or (N, n)."""

    load_torque: Array
    """tau_LD, torque that the motor must overcome [N m]."""
    alleviating_torque: Array
    """tau_alleviate, signed help of the other motors towards the planned acceleration [N m]."""


def decouple(
    inertial: ArrayLike,
    coupled: ArrayLike,
    gear_ratio: ArrayLike,
    sign: str = "consistent",
) -> Loads:
    """Compute the loads of the motors from torque groups by Algorithm 1 of the paper.

    The three branches are one expression. With own = d_kk vd_k, the help is the part of
    -tau_coupled that has the direction of `own` and does not exceed it:

        r tau_alleviate = clip(-tau_coupled, min(own, 0), max(own, 0))
        r tau_LD        = tau_coupled + r tau_alleviate

    Then tau_coupled = r (tau_LD - tau_alleviate) holds. In the third branch (acceleration and
    coupling opposed, coupling larger), the paper prints tau_LD = -tau_k / r, which violates this
    identity by 2 tau_k; `sign="printed"` follows the paper.

    Algorithm 1 compares signs, and sign(0) is 0 here. A joint without acceleration of its own is
    therefore in the third branch, whatever its coupling torque is. The consistent loads do not
    depend on this, but the printed load is then -tau_coupled / r.

    >>> decouple(inertial=[2.0], coupled=[-5.0], gear_ratio=[10])
    Loads(load_torque=array([-0.3]), alleviating_torque=array([0.2]))
    >>> decouple([0.0, 1e-12], [5.0, 5.0], [1, 1], sign="printed").load_torque
    array([-5.,  5.])

    Args:
        inertial: d_kk vd_k, joint side [N m], shape (n,) or (N, n).
        coupled: tau_coupled of Eq. 4, joint side [N m], same shape.
        gear_ratio: r, motor speed over joint speed [-], shape (n,).
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
    """Compute I_eff = I_m + d_kk / r² (Eq. 3), **motor side** [kg m²].

    I_m contains other motors that turn with the joint; see `Robot.motor_inertia`.

    Args:
        robot: the robot, with rotor inertias I_m and gear ratios r.
        d_kk: diagonal of the links' mass matrix, joint side [kg m²], shape (n,) or (N, n).
    """
    return robot.motor_inertia + np.asarray(d_kk) / robot.gear_ratio**2


def where_largest(d_kk: ArrayLike) -> NDArray[np.intp]:
    """Find the first sample with the largest inertia of each joint, within round-off.

    Args:
        d_kk: diagonal of the links' mass matrix, joint side [kg m²], shape (N, n).

    Returns:
        Indices of samples, shape (n,).
    """
    d_kk = np.asarray(d_kk)
    return np.argmax(d_kk >= (1 - 1e-9) * d_kk.max(axis=0), axis=0)


@dataclass(frozen=True, eq=False)
class InertiaRange:
    """The range of I_eff along a motion, motor side [kg m²]; each of shape (n,)."""

    maximum: Array
    """Largest I_eff."""
    median: Array
    """Median of I_eff over the samples."""
    minimum: Array
    """Smallest I_eff."""

    @staticmethod
    def of(i_eff: Array) -> "InertiaRange":
        """Compute the range of I_eff, shape (N, n)."""
        return InertiaRange(
            maximum=np.max(i_eff, axis=0),
            median=np.median(i_eff, axis=0),
            minimum=np.min(i_eff, axis=0),
        )

    @property
    def variation_percent(self) -> Array:
        """Variation (max - min) / max [%], as in Table 1; 0 for round-off of a constant inertia."""
        variation = 100 * (1 - self.minimum / self.maximum)
        return np.where(variation < 1e-9, 0.0, variation)
