"""The motion of the pilot's head: specific force and angular velocity at the frame `head`."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike
from pydrake.multibody.tree import UniformGravityFieldElement

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.robot.robot import Robot

HEAD_FRAME = "head"
"""The SDF frame between the pilot's ears: x forward, y left, z up."""

GRAVITY = UniformGravityFieldElement.kDefaultStrength
"""Acceleration of 1 G: Drake's gravity [m/s²]."""


@dataclass(frozen=True, eq=False)
class HeadMotion:
    """The motion of the head at N samples, in the axes of the head (x forward, y left, z up)."""

    specific_force: Array
    """f = R^T (a - g), as an accelerometer in the head measures it [m/s²], shape (N, 3). An upright
    head at rest has +9.81 along z."""
    angular_velocity: Array
    """Angular velocity [rad/s], shape (N, 3): x roll right, y nose down, z to the left."""
    angular_acceleration: Array
    """Angular acceleration [rad/s²], shape (N, 3)."""
    position: Array
    """Position in the **world** [m], shape (N, 3)."""
    rotation: Array
    """R, rotation from head to world, shape (N, 3, 3)."""

    @property
    def resultant_g(self) -> Array:
        """|f| divided by gravity [-], shape (N,)."""
        return np.linalg.norm(self.specific_force, axis=1) / GRAVITY

    @cached_property
    def force_in_world(self) -> Array:
        """R f = a - g, in the **world** [m/s²], shape (N, 3)."""
        return np.einsum("fij,fj->fi", self.rotation, self.specific_force)


def has_head(robot: Robot) -> bool:
    """Check whether the robot has a frame `head`, which the perception of the pilot needs.

    Perception also applies to runs on the axis plant. Its joints move independently, but at the
    same time, and together they place the head.
    """
    return robot.plant.HasFrameNamed(HEAD_FRAME)


def check_head(robot: Robot) -> None:
    """Check that the robot has a pilot's head.

    Raises:
        InputError: no head; the message has the element to add.
    """
    if not has_head(robot):
        on = "link" if robot.path.suffix.lower() == ".urdf" else "attached_to"
        raise InputError(
            f'{robot.path}: no pilot\'s head; add <frame name="{HEAD_FRAME}" '
            f'{on}="LINK"> between the ears, x forward, y left, z up'
        )


def head_motion(robot: Robot, q: ArrayLike, v: ArrayLike, vd: ArrayLike) -> HeadMotion:
    """Compute the motion of the head from a motion of the joints.

    >>> from sdt_drake.robot.robot import load_robot
    >>> rest = np.zeros((1, 4))
    >>> head_motion(load_robot(), rest, rest, rest).specific_force.round(2)
    array([[0.  , 0.  , 9.81]])

    The recursion goes from base to tip, in the world. Joint k at p_k has the axis e_k, and r_k
    leads to the next joint:

        omega_k = omega_{k-1} + e_k v_k
        alpha_k = alpha_{k-1} + e_k vd_k + omega_{k-1} x e_k v_k
        p_{k+1} = p_k + r_k,   a_{k+1} = a_k + alpha_k x r_k + omega_k x (omega_k x r_k)

    Args:
        robot: a robot with a frame `head`.
        q: joint positions [rad], shape (N, n).
        v: joint speeds [rad/s], shape (N, n).
        vd: joint accelerations [rad/s²], shape (N, n).

    Raises:
        InputError: the robot has no head.
    """
    q, v, vd = (np.asarray(a, dtype=float) for a in (q, v, vd))
    axes, origins, head_at_zero = _chain_at_zero(robot)
    zero = np.zeros((len(q), 3))
    rotation = np.broadcast_to(np.eye(3), (len(q), 3, 3))  # of a link, relative to q = 0
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
    """Compute the motion of the head from positions and speeds of the joints alone.

    The acceleration of sample i is the central difference (v_{i+1} - v_{i-1}) / (2 period). It is
    centred in time like q and v, for planned and measured motions alike.

    Args:
        robot: a robot with a frame `head`.
        period: sample period [s].
        q: joint positions [rad], shape (N, n), N >= 2.
        v: joint speeds [rad/s], shape (N, n).

    Raises:
        InputError: the robot has no head.
    """
    v = np.asarray(v, dtype=float)
    return head_motion(robot, q, v, np.gradient(v, period, axis=0))


@lru_cache(maxsize=8)  # searches for a motion ask for it thousands of times
def _chain_at_zero(robot: Robot) -> tuple[list[Array], list[Array], Array]:
    """Return the joints that move the head, at q = 0, in the world.

    Returns:
        Axes of the joints, origins of the joints and then of the head [m], rotation of the head.
    """
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
    """Return the rotations about a unit vector by angles [rad], shape (N,) (Rodrigues' formula)."""
    x, y, z = axis
    S = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sine, versine = np.sin(angle)[:, None, None], (1 - np.cos(angle))[:, None, None]
    return np.eye(3) + sine * S + versine * (S @ S)
