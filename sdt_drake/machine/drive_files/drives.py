"""What the drives of the axes read: the units of their set points, CiA 402."""

from collections.abc import Callable
from dataclasses import dataclass
from math import tau
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import (
    EachJoint,
    Input,
    Number,
    OneOf,
    Positive,
    Problems,
    Some,
    check,
    setting,
)
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.robot.robot import Robot

POSITION, SPEED, TORQUE = "position", "speed", "torque"

INT16, INT32 = 2**15 - 1, 2**31 - 1

OBJECTS = {
    "607Ah": ("TargetPosition", POSITION),
    "60FFh": ("TargetVelocity", SPEED),
    "60B1h": ("VelocityOffset", SPEED),
    "60B2h": ("TorqueOffset", TORQUE),
    "6071h": ("TargetTorque", TORQUE),
}
"""Objects of CiA 402-2 (IEC 61800-7-201) by index: name, and what it holds."""

SPEED_UNITS = {
    "increments/s": 0.0,
    "rpm": 1.0,
    "0.1 rpm": 0.1,
    "0.01 rpm": 0.01,
    "0.001 rpm": 0.001,
}
"""Of 60FFh and 60B1h: increments of the encoder, or turns of the motor per minute [rpm]."""


@dataclass(kw_only=True)
class Axis(Input):
    """The drive of a joint; **motor side**."""

    increments: int = setting(ge=1, unit="increments", side="motor")
    """Of the encoder in a turn of the motor."""
    gear_ratio: Positive | None = setting(None, unit="-")
    """Motor speed over joint speed; by default that of the robot."""
    sign: int = setting(1, unit="-")
    """1, or -1 where the motor turns against its joint."""
    zero: int = setting(0, unit="increments")
    """Increments at the joint angle 0."""
    speed_unit: Annotated[str, OneOf(tuple(SPEED_UNITS))] = "increments/s"
    """Of target velocity and velocity offset."""
    rated_torque: Positive = setting(unit="N m", side="motor")
    """That torques in per mille refer to (6076h), rated or standstill."""
    maximum_torque: Positive | None = setting(None, unit="N m", side="motor")
    """Of the drive; by default as far as per mille in 16 bits go, where it reads torques."""
    objects: Some[Annotated[str, OneOf(tuple(OBJECTS))]] = setting(["607Ah", "60B1h", "60B2h"])
    """Of CiA 402 that it reads in every cycle."""

    def problems(self) -> Problems:
        if self.sign not in (1, -1):
            yield "sign", f"{self.sign}, expected 1 or -1"
        for i, index in enumerate(self.objects):
            if index in self.objects[:i]:
                yield f"objects[{i + 1}]", f"{index} is given twice"
        if not {"607Ah", "60FFh"} & set(self.objects):  # what the offsets are added to
            yield "objects", "neither a position nor a speed, expected 607Ah or 60FFh among them"


@dataclass(kw_only=True)
class Drives(Input):
    """The drives of a device."""

    notes: str = ""
    """For people."""
    cycle_time: Number = setting(gt=0, le=1, unit="s")
    """Of the set points."""
    axes: EachJoint[Axis]
    """Base to tip."""

    def zeros(self) -> Array:
        """Increments of the drives at the joint angles 0, shape (n,)."""
        return np.array([axis.zero for axis in self.axes], dtype=float)

    def increments_per_rad(self, robot: Robot) -> Array:
        """Increments of each drive per rad of each joint angle, with the sign of its axis; shape
        (n, n)."""
        return self._per_joint(robot, lambda axis: axis.increments / tau)

    def speed_per_increment(self) -> Array:
        """Speed units in an increment per second, shape (n,)."""
        rpm = [SPEED_UNITS[axis.speed_unit] for axis in self.axes]
        turns = [60 / axis.increments for axis in self.axes]
        return np.array([x / unit if unit else 1.0 for x, unit in zip(turns, rpm, strict=True)])

    def torque_per_mille(self, robot: Robot) -> Array:
        """Torque at each joint [N m] in 1 per mille of the rated torque of each motor, with the
        sign of its axis; shape (n, n), a row for each motor."""
        return self._per_joint(robot, lambda axis: axis.rated_torque / 1000)

    def most_per_mille(self) -> Array:
        """Largest magnitude of a torque, in per mille of the rated one, shape (n,)."""
        given = [axis.maximum_torque or np.inf for axis in self.axes]
        rated = np.array([axis.rated_torque for axis in self.axes])
        return np.minimum(1000 * np.array(given) / rated, self.most(TORQUE, INT16))

    def most(self, quantity: str, most: int) -> Array:
        """What the bits of a set point hold, of axes that read one; shape (n,)."""
        return np.where(self.reads(quantity), most, np.inf)

    def reads(self, quantity: str) -> NDArray[np.bool_]:
        """Which axes have a set point of a quantity: POSITION, SPEED or TORQUE; shape (n,)."""
        read = [{OBJECTS[index][1] for index in axis.objects} for axis in self.axes]
        return np.array([quantity in quantities for quantities in read])

    def _per_joint(self, robot: Robot, of_motor: Callable[[Axis], float]) -> Array:
        """What a motor has in a unit of its own angle or torque, in one of each joint's."""
        own = [
            axis.sign * (axis.gear_ratio or r) / r * of_motor(axis)
            for axis, r in zip(self.axes, robot.gear_ratio, strict=True)
        ]
        return np.array(own)[:, None] * robot.coupling


def load_drives(path: str | Path, n: int) -> Drives:
    """The drives of a robot with `n` joints, from YAML, or the shipped ones of a name.

    Raises:
        InputError: with a line for each problem: file, field, and what would be right.
    """
    drives, file = load_yaml(Drives, path, "drives")
    check(drives, str(file), n)
    return drives
