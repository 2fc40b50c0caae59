"""Robots in Pinocchio, and its inverse dynamics.

Independent: another library computes the torque, by a recursion of Newton and Euler over joints
that it has been told one by one. Only where joints and links are, and their inertias, come from the
robot that was loaded; the tests of files check those by numbers of their own.
"""

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
