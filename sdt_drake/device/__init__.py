"""What a real device adds to a rigid, frictionless plant with ideal drives: data and laws."""

from sdt_drake.device.drive import Drive
from sdt_drake.device.elasticity import ENCODERS, Elasticity, ElasticJoints, elastic_joints
from sdt_drake.device.friction import (
    OVERFLOW_RATE,
    PRESLIDING_DAMPING_TIME,
    Friction,
    JointFriction,
    joint_friction,
    sliding_friction,
)

__all__ = [
    "ENCODERS",
    "OVERFLOW_RATE",
    "PRESLIDING_DAMPING_TIME",
    "Drive",
    "ElasticJoints",
    "Elasticity",
    "Friction",
    "JointFriction",
    "elastic_joints",
    "joint_friction",
    "sliding_friction",
]
