"""Motion of the pilot's head: specific force and angular velocity at the frame `head`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from pydrake.multibody.tree import UniformGravityFieldElement

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.robot.robot import Robot

HEAD_FRAME = "head"
"""The SDF frame between the pilot's ears: x forward, y left, z up."""

GRAVITY = UniformGravityFieldElement.kDefaultStrength
"""What counts as 1 G: Drake's gravity [m/s²]."""


@dataclass(frozen=True, eq=False)
class HeadMotion:
    """The head at N samples; vectors in the axes of the head (x forward, y left, z up).

    Attributes:
        specific_force: f = R^T (a - g), what an accelerometer in the head shows [m/s²], shape
            (N, 3); +9.81 along z for a head that is upright and at rest.
        angular_velocity: [rad/s], shape (N, 3): about x roll to the right, about y nose down,
            about z to the left.
        angular_acceleration: [rad/s²], shape (N, 3).
        position: in the **world** [m], shape (N, 3).
        rotation: R, from head to world, shape (N, 3, 3).
    """

    specific_force: Array
    angular_velocity: Array
    angular_acceleration: Array
    position: Array
    rotation: Array

    @property
    def resultant_g(self) -> Array:
        """|f| in units of gravity [-], shape (N,)."""
        return np.linalg.norm(self.specific_force, axis=1) / GRAVITY

    @cached_property
    def force_in_world(self) -> Array:
        """R f = a - g, in the **world** [m/s²], shape (N, 3)."""
        return np.einsum("fij,fj->fi", self.rotation, self.specific_force)


def has_head(robot: Robot) -> bool:
    """Whether the file says where the pilot's head is: then what is felt can be told of every run.

    Of one on the axis plant, too. Its joints move each on its own, but over the same time, and the
    head is where they put it together: what is felt there is as true as the joints' errors are.
    """
    return robot.plant.HasFrameNamed(HEAD_FRAME)


def check_head(robot: Robot) -> None:
    """Refuse a robot without a head.

    Raises:
        InputError: saying how to add one.
    """
    if not has_head(robot):
        on = "link" if robot.path.suffix == ".urdf" else "attached_to"
        raise InputError(
            f'{robot.path}: no pilot\'s head; add <frame name="{HEAD_FRAME}" '
            f'{on}="LINK"> between the ears, x forward, y left, z up'
        )


def head_motion(robot: Robot, q: ArrayLike, v: ArrayLike, vd: ArrayLike) -> HeadMotion:
    """Motion of the head for joint angles [rad], speeds [rad/s] and accelerations [rad/s²].

    From base to tip, in the world: joint k at p_k with axis e_k, r_k from it to the next joint,

        omega_k = omega_{k-1} + e_k v_k
        alpha_k = alpha_{k-1} + e_k vd_k + omega_{k-1} x e_k v_k
        p_{k+1} = p_k + r_k,   a_{k+1} = a_k + alpha_k x r_k + omega_k x (omega_k x r_k)

    Args:
        robot: with a frame `head`.
        q, v, vd: shape (N, n) each.

    Raises:
        InputError: if the robot has no head.
    """
    q, v, vd = (np.asarray(a, dtype=float) for a in (q, v, vd))
    axes, origins, head_at_zero = _chain_at_zero(robot)
    zero = np.zeros((len(q), 3))
    rotation = np.broadcast_to(np.eye(3), (len(q), 3, 3))  # of a link, from where it is at q = 0
    position, acceleration, omega, alpha = zero + origins[0], zero, zero, zero
    for k, (axis_at_zero, to_next) in enumerate(zip(axes, np.diff(origins, axis=0), strict=True)):
        turn = (rotation @ axis_at_zero) * v[:, k, None]
        alpha = alpha + (rotation @ axis_at_zero) * vd[:, k, None] + np.cross(omega, turn)
        omega = omega + turn
        rotation = rotation @ turned(axis_at_zero, q[:, k])
        r = rotation @ to_next
        position = position + r
        acceleration = acceleration + np.cross(alpha, r) + np.cross(omega, np.cross(omega, r))
    rotation = rotation @ head_at_zero
    gravity = robot.plant.gravity_field().gravity_vector()

    def in_head(vectors: Array) -> Array:
        return np.einsum("nji,nj->ni", rotation, vectors)

    return HeadMotion(
        specific_force=in_head(acceleration - gravity),
        angular_velocity=in_head(omega),
        angular_acceleration=in_head(alpha),
        position=position,
        rotation=rotation,
    )


def head_motion_of_samples(robot: Robot, period: float, q: ArrayLike, v: ArrayLike) -> HeadMotion:
    """Motion of the head for joints sampled every `period` [s].

    The acceleration of sample i is (v_{i+1} - v_{i-1}) / (2 period), the mean over the two periods
    around it: centred in time, so it stays in step with q and v, and the same rule for a reference
    whose acceleration jumps at a sample and for a motion that was measured.

    Args:
        robot: with a frame `head`.
        period: [s].
        q, v: joint angles [rad] and speeds [rad/s], shape (N, n), N >= 2.

    Raises:
        InputError: if the robot has no head.
    """
    v = np.asarray(v, dtype=float)
    return head_motion(robot, q, v, np.gradient(v, period, axis=0))


def _chain_at_zero(robot: Robot) -> tuple[list[Array], list[Array], Array]:
    """The chain at q = 0, in the world: axes of the joints between the world and the head, where
    these and the head are [m], and the head's rotation."""
    check_head(robot)
    plant, head = robot.plant, robot.plant.GetFrameByName(HEAD_FRAME)
    head_pose = head.CalcPoseInWorld(robot.context_at_zero())
    axes, origins = [], []
    for name in robot.joint_names:
        moved = plant.GetBodiesKinematicallyAffectedBy([plant.GetJointByName(name).index()])
        if head.body().index() in moved:
            axis, origin = robot.joint_at_zero(name)
            axes.append(axis)
            origins.append(origin)
    return axes, [*origins, head_pose.translation()], head_pose.rotation().matrix()


def turned(axis: Array, angle: Array) -> Array:
    """Rotations about a unit vector by angles [rad] of shape (N,): (N, 3, 3) (Rodrigues)."""
    x, y, z = axis
    S = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sine, versine = np.sin(angle)[:, None, None], (1 - np.cos(angle))[:, None, None]
    return np.eye(3) + sine * S + versine * (S @ S)
