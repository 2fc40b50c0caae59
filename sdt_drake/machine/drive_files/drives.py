"""The drives of the axes and the units of their set points (CiA 402)."""

from collections.abc import Callable
from dataclasses import dataclass
from math import tau
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io import fields
from sdt_drake.io.arrays import Array
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
"""Objects of CiA 402-2 (IEC 61800-7-201) by index: name and quantity."""

SPEED_UNITS = {
    "increments/s": 0.0,
    "rpm": 1.0,
    "0.1 rpm": 0.1,
    "0.01 rpm": 0.01,
    "0.001 rpm": 0.001,
}
"""Units of 60FFh and 60B1h in rpm of the motor; 0 for encoder increments per second."""


@dataclass(frozen=True, kw_only=True)
class Axis(fields.Input):
    """The drive of a joint; **motor side**."""

    increments: fields.Integer = fields.field(ge=1, unit="increments", side="motor")
    """Encoder increments per turn of the motor."""
    gear_ratio: fields.Positive | None = fields.field(None, unit="-")
    """Motor speed over joint speed; the robot's gear ratio by default."""
    sign: fields.Integer = fields.field(1, unit="-")
    """Direction: 1, or -1 if the motor turns against its joint."""
    zero: fields.Integer = fields.field(0, unit="increments")
    """Encoder increments at joint angle 0."""
    speed_unit: Literal["increments/s", "rpm", "0.1 rpm", "0.01 rpm", "0.001 rpm"] = "increments/s"
    """Unit of target velocity and velocity offset."""
    rated_torque: fields.Positive = fields.field(unit="N m", side="motor")
    """Rated (or standstill) torque, to which torques in per mille refer (6076h)."""
    maximum_torque: fields.Positive | None = fields.field(None, unit="N m", side="motor")
    """Maximum torque of the drive; by default the largest per mille value of 16 bits, if the
    drive reads torques."""
    objects: fields.NonEmpty[Literal["607Ah", "60FFh", "60B1h", "60B2h", "6071h"]] = fields.field(
        ("607Ah", "60B1h", "60B2h")
    )
    """CiA 402 objects that the drive reads in every cycle."""

    def problems(self) -> fields.Problems:
        if self.sign not in (1, -1):
            yield "sign", f"{self.sign}, expected 1 or -1"
        for i, index in enumerate(self.objects):
            if index in self.objects[:i]:
                yield f"objects[{i + 1}]", f"{index} is given twice, expected once"
        if not {"607Ah", "60FFh"} & set(self.objects):  # the offsets are added to these
            yield "objects", "neither a position nor a speed, expected 607Ah or 60FFh among them"


@dataclass(frozen=True, kw_only=True)
class Drives(fields.Input):
    """The drives of a device."""

    notes: str = ""
    """Remarks; not used."""
    cycle_time: fields.Number = fields.field(gt=0, le=1, unit="s")
    """Drive period: time between two set points."""
    axes: fields.EachJoint[Axis]
    """Drives of the joints, base to tip."""

    def zeros(self) -> Array:
        """Return the increments of the drives at joint angles 0, shape (n,)."""
        return np.array([axis.zero for axis in self.axes], dtype=float)

    def increments_per_rad(self, robot: Robot) -> Array:
        """Return signed increments per rad, shape (n, n): a row per drive, a column per joint."""
        return self._per_joint(robot, lambda axis: axis.increments / tau)

    def speed_per_increment(self) -> Array:
        """Return the speed units per increment/s, shape (n,)."""
        rpm = [SPEED_UNITS[axis.speed_unit] for axis in self.axes]
        turns = [60 / axis.increments for axis in self.axes]
        return np.array([x / unit if unit else 1.0 for x, unit in zip(turns, rpm, strict=True)])

    def torque_per_mille(self, robot: Robot) -> Array:
        """Return signed joint torque [N m] per 1/1000 of the rated torque of a motor.

        Shape (n, n): a row per motor, a column per joint.
        """
        return self._per_joint(robot, lambda axis: axis.rated_torque / 1000)

    def max_per_mille(self) -> Array:
        """Return the largest torque in per mille of the rated torque, shape (n,)."""
        given = [axis.maximum_torque or np.inf for axis in self.axes]
        rated = np.array([axis.rated_torque for axis in self.axes])
        return np.minimum(1000 * np.array(given) / rated, self.max_integer(TORQUE, INT16))

    def max_integer(self, quantity: str, limit: int) -> Array:
        """Return `limit` for axes that read a quantity, infinity for the others, shape (n,)."""
        return np.where(self.reads(quantity), limit, np.inf)

    def reads(self, quantity: str) -> NDArray[np.bool_]:
        """Return the mask of axes that read POSITION, SPEED or TORQUE, shape (n,)."""
        read = [{OBJECTS[index][1] for index in axis.objects} for axis in self.axes]
        return np.array([quantity in quantities for quantities in read])

    def _per_joint(self, robot: Robot, of_motor: Callable[[Axis], float]) -> Array:
        """Return a motor-side factor per unit of joint angle or torque, shape (n, n)."""
        own = [
            axis.sign * (axis.gear_ratio or r) / r * of_motor(axis)
            for axis, r in zip(self.axes, robot.gear_ratio, strict=True)
        ]
        return np.array(own)[:, None] * robot.coupling


def load_drives(path: str | Path, n: int) -> Drives:
    """Load the drives of a robot with `n` joints from a YAML file, or shipped ones by name.

    Raises:
        InputError: with a line for each problem: file, field, and what is accepted.

    >>> load_drives("package://sdt/drives.yaml", 4).cycle_time
    0.001
    """
    drives, file = load_yaml(Drives, path, "drives")
    fields.check_joints(drives, file, n)
    return drives
