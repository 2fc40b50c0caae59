"""What a real device adds to a rigid, frictionless plant with ideal drives; and a chosen one."""

from sdt_drake.device.choice import DeviceChoice, chosen_robot, motors_in_use
from sdt_drake.device.elasticity import ENCODERS, Elasticity, Springs, springs_of
from sdt_drake.device.friction import (
    OVERFLOW_RATE,
    PRESLIDING_DAMPING_TIME,
    Friction,
    FrictionParameters,
    friction_parameters,
    sliding_friction,
    sliding_stretch,
)
from sdt_drake.device.motors import DEFAULT_CATALOGUE, Catalogue, Drive, Motor, load_catalogue

__all__ = [
    "DEFAULT_CATALOGUE", "ENCODERS", "OVERFLOW_RATE", "PRESLIDING_DAMPING_TIME", "Catalogue",
    "DeviceChoice", "Drive", "Elasticity", "Friction", "FrictionParameters", "Motor", "Springs",
    "chosen_robot", "friction_parameters", "load_catalogue", "motors_in_use", "sliding_friction",
    "sliding_stretch", "springs_of",
]  # fmt: skip
