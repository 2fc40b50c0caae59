"""Robots in Pinocchio, and its inverse dynamics.

Independent: another library computes the torque, by a recursion of Newton and Euler over joints
that it has been told one by one. Only where joints and links are, and their inertias, come from the
robot that was loaded; the tests of files check those by numbers of their own.
"""

import numpy as np
import pytest

from sdt_drake.robot.parsed import parts_of


def pinocchio_robot(robot):
    """The library and its model: the links alone, without friction."""
    pin = pytest.importorskip("pinocchio")
    model, parent, context = pin.Model(), 0, robot.context_at_zero()
    for name in robot.joint_names:
        joint = robot.plant.GetJointByName(name)
        pose = joint.frame_on_parent().GetFixedPoseInBodyFrame()
        place = pin.SE3(pose.rotation().matrix(), pose.translation())
        turning = pin.JointModelRevoluteUnaligned(joint.revolute_axis())
        parent = model.addJoint(parent, turning, place, name)
        for body in robot.plant.GetBodiesWeldedTo(joint.child_body()):
            pose = body.body_frame().CalcPose(context, joint.frame_on_child())
            place = pin.SE3(pose.rotation().matrix(), pose.translation())
            model.appendBodyToJoint(parent, pin.Inertia(*parts_of(body)), place)
    return pin, model


def pinocchio_torque(robot, q, v, vd):
    """Of the links alone, without friction."""
    pin, model = pinocchio_robot(robot)
    return pin.rnea(model, model.createData(), q, v, vd)


def urdf_torque(robot, q, v, vd):
    """Of the links of a robot's URDF as Pinocchio reads it, with held joints at their positions."""
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromUrdf(str(robot.path))
    data, full = model.createData(), [pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)]

    def put(name, angle):
        joint = model.joints[model.getJointId(name)]
        turns = joint.nq == 2 and joint.nv == 1  # continuous: cosine and sine
        full[0][joint.idx_q : joint.idx_q + joint.nq] = (
            [np.cos(angle), np.sin(angle)] if turns else angle
        )
        return joint.idx_v

    for name, position in robot.held.items():
        if model.existJointName(name):
            put(name, position)
    torque = []
    for sample in zip(q, v, vd, strict=True):
        at = [put(name, angle) for name, angle in zip(robot.joint_names, sample[0], strict=True)]
        full[1][at], full[2][at] = sample[1:]
        torque.append(pin.rnea(model, data, *full)[at])
    return np.array(torque)
