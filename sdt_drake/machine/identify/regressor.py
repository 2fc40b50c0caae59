"""Joint torques of rigid links, linear in their inertial parameters.

Ten parameters describe a body (Atkeson, An and Hollerbach, "Estimation of inertial parameters of
manipulator loads and links", Int. J. Robotics Research 5(3), 1986): mass m, first moment h = m c,
and the inertia I about the origin of its frame. Then force and moment on it are linear in them,
and by the principle of virtual power the torques of the joints are

    tau = sum over bodies of J(q)^T A(V, dV/dt) phi = Y(q, v, vd) phi
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.tree import Frame, RevoluteJoint

from sdt_drake.io.arrays import Array
from sdt_drake.pilot.head import turned
from sdt_drake.robot.robot import Robot

PARAMETERS = ("mass", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""Parameters of a body: m [kg], h = m c [kg m], I about the origin of its frame [kg m²]."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """The bodies that joints turn, with welded links as one body.

    Frame k has its origin on the axis of joint k. It is the joint's frame on its child link, in
    which the file gives the axis. In most files it is the frame of that link.
    """

    names: tuple[str, ...]
    """Links of each body, "gondola + payload"."""
    rotation: Array
    """Rotation matrix of frame k in frame k - 1 (or the world) at q_k = 0, shape (n, 3, 3)."""
    position: Array
    """Origin of frame k in frame k - 1 (or the world) [m], shape (n, 3)."""
    axis: Array
    """Unit vector of the axis of joint k in frame k, shape (n, 3)."""
    gravity: Array
    """Gravity in the world frame [m/s²], shape (3,)."""
    parameters: Array
    """Parameters of the robot's bodies, shape (n, 10); see PARAMETERS."""

    @staticmethod
    def of(robot: Robot) -> Bodies:
        """Return the bodies of a robot."""
        plant, context = robot.plant, robot.context_at_zero()
        joints = [plant.GetJointByName(name) for name in robot.joint_names]
        names, rotation, position, axis, parameters = [], [], [], [], []
        parent: Frame = plant.world_frame()
        for joint in joints:
            assert isinstance(joint, RevoluteJoint)
            pose = joint.frame_on_parent().CalcPose(context, parent)
            parent = joint.frame_on_child()
            links = plant.GetBodiesWeldedTo(joint.child_body())
            whole = plant.CalcSpatialInertia(context, parent, [link.index() for link in links])
            names.append(" + ".join(link.name() for link in links))
            rotation.append(pose.rotation().matrix())
            position.append(pose.translation())
            axis.append(joint.revolute_axis())
            inertia = whole.CalcRotationalInertia().CopyToFullMatrix3()
            first_moment = whole.get_mass() * whole.get_com()
            parameters.append([whole.get_mass(), *first_moment, *inertia[np.triu_indices(3)]])
        gravity = plant.gravity_field().gravity_vector()
        arrays = (rotation, position, axis, gravity, parameters)
        return Bodies(tuple(names), *map(np.array, arrays))


def regressor(robot: Robot, q: Array, v: Array, vd: Array, gravity: Array | None = None) -> Array:
    """Return Y of tau = Y phi, the torque of rigid links without motors, **joint side**.

    With phi = Bodies.of(robot).parameters.ravel(), Y phi is the total of `torque_groups` of a robot
    without joint damping.

        >>> import numpy as np
        >>> from sdt_drake.robot.robot import load_robot
        >>> robot, still = load_robot("sdt"), np.zeros((1, 4))
        >>> phi = Bodies.of(robot).parameters.ravel()
        >>> gravity = regressor(robot, np.array([[0, 0.5, 0, 0]]), still, still) @ phi
        >>> gravity.round(1)[0, 1:3].tolist()  # torque at standstill [N m]
        [872.8, 0.0]

    Args:
        robot: The robot with its kinematics and gravity; its masses have no effect.
        q: Joint positions [rad], shape (N, n).
        v: Joint speeds [rad/s], shape (N, n).
        vd: Joint accelerations [rad/s²], shape (N, n).
        gravity: Gravity in the world frame [m/s²], shape (3,); by default that of the robot.

    Returns:
        Y, shape (N, n, 10 n). Columns 10 k to 10 k + 9 belong to the body that joint k turns.
    """
    bodies = Bodies.of(robot)
    samples, n = q.shape
    Y = np.zeros((samples, n, 10 * n))
    J = np.zeros((samples, n, 6))  # rows: twist of the body over joint speed, in the body's frame
    omega, alpha = np.zeros((2, samples, 3))
    gravity = bodies.gravity if gravity is None else gravity
    a = np.broadcast_to(-gravity, (samples, 3))  # acceleration of the frame's origin less gravity
    for k in range(n):
        axis, p = bodies.axis[k], bodies.position[k]
        R = bodies.rotation[k] @ turned(axis, q[:, k])
        a = a + np.cross(alpha, p) + np.cross(omega, np.cross(omega, p))
        J[..., 3:] += np.cross(J[..., :3], p)
        J = np.concatenate([J[..., :3] @ R, J[..., 3:] @ R], axis=2)
        J[:, k, :3] = axis
        a, omega, alpha = (np.einsum("ni,nij->nj", x, R) for x in (a, omega, alpha))
        spin = v[:, k, None] * axis
        alpha = alpha + vd[:, k, None] * axis + np.cross(omega, spin)
        omega = omega + spin
        Y[:, : k + 1, 10 * k : 10 * k + 10] = J[:, : k + 1] @ _wrench(a, omega, alpha)
    return Y


def _wrench(a: Array, omega: Array, alpha: Array) -> Array:
    """Return A of [moment, force] = A phi about the origin of the body's frame, shape (N, 6, 10).

    moment = h x a + I alpha + omega x (I omega),  force = m a + alpha x h + omega x (omega x h)
    """
    A = np.zeros((len(a), 6, 10))
    spin = _cross(omega)
    A[:, :3, 1:4] = -_cross(a)
    A[:, :3, 4:] = _times_inertia(alpha) + spin @ _times_inertia(omega)
    A[:, 3:, 0] = a
    A[:, 3:, 1:4] = _cross(alpha) + spin @ spin
    return A


def _cross(x: Array) -> Array:
    """Return the matrices of the cross product with x, shape (..., 3, 3)."""
    matrix = np.zeros((*x.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[..., i, j], matrix[..., j, i] = -x[..., k], x[..., k]
    return matrix


def _times_inertia(x: Array) -> Array:
    """Return L of I x = L [Ixx, Ixy, Ixz, Iyy, Iyz, Izz], shape (N, 3, 6)."""
    L = np.zeros((len(x), 3, 6))
    for column, (i, j) in enumerate(zip(*np.triu_indices(3), strict=True)):
        L[:, i, column], L[:, j, column] = x[:, j], x[:, i]
    return L
