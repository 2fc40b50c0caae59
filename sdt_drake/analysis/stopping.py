"""Emergency stops as data: what drives and brakes do, and limits of the figures of a stop."""

from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import (
    EachJoint,
    EachJointOrNone,
    FileOf,
    Input,
    Integer,
    NotNegative,
    Positive,
    Problems,
    Text,
    check_joints,
    field,
)
from sdt_drake.io.names import given_fields
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.robot.brakes import Brake, Brakes
from sdt_drake.robot.motors import DEFAULT_CATALOGUE, DeviceChoice, load_catalogue
from sdt_drake.robot.robot import Robot
from sdt_drake.run.stopping import Schedule


@dataclass(frozen=True)
class StopLimits(Input):
    """The largest allowed figures of any stop; what is not given has no limit.

    The energy of a brake is limited by the `energy` of its motor in the catalogue.
    """

    stopping_time: EachJoint[Positive] | None = field(None, unit="s")
    """Time until each joint rests."""
    stopping_angle_deg: EachJoint[Positive] | None = field(None, unit="deg", side="joint")
    """Angle by which each joint goes on."""
    g: Positive | None = field(None, unit="G")
    """Resultant at the head, gravity included."""
    g_onset: Positive | None = field(None, unit="G/s")
    """Change of the resultant within `onset_window`, up or down."""
    head_rate: Positive | None = field(None, unit="rad/s")
    """Angular rate of the head."""
    head_acceleration: Positive | None = field(None, unit="rad/s²")
    """Angular acceleration of the head."""
    joint_stop_speed_deg: NotNegative | None = field(None, unit="deg/s", side="joint")
    """Speed at which a joint reaches one of its stops; 0: none may be reached."""
    brake_load: Positive | None = field(None, unit="-")
    """Share of the static torque of a brake that gravity takes where its joint comes to rest."""
    drive_torque: Positive | None = field(None, unit="-")
    """Share of the torque of a motor that a ramp takes."""

    @property
    def is_none(self) -> bool:
        """True without any limit."""
        return not [*given_fields(self)]

    def by_figure(self, brakes: Brakes) -> dict[str, Array]:
        """Return the limits by name of the figure, SI units, shape (n,) or ()."""
        limits = {"brake_energy": brakes.energy}
        for name, value in given_fields(self):
            unit = np.radians(1.0) if name.endswith("_deg") else 1.0
            limits[name.removesuffix("_deg")] = unit * np.array(value)
        return limits


@dataclass(frozen=True, kw_only=True)
class Stopping(Input):
    """An emergency stop by IEC 60204-1: what drives and brakes do, and the limits that you set.

    None of it, and no figure computed with it, is a statement on safety.
    """

    category: Integer = field(0, ge=0, le=2, unit="-")
    """0: power off at once, brakes close after their delay. 1: drives decelerate along a ramp, then
    brakes close and power goes off. 2: the same ramp, power stays on."""
    ramp: Literal["joint", "coordinated"] = "coordinated"
    """"joint": each joint has its own deceleration. "coordinated": all joints come to rest together
    with the one that takes longest."""
    deceleration: EachJoint[Positive] | None = field(None, unit="rad/s²", side="joint")
    """Deceleration of the ramps, which categories 1 and 2 need. A ramp is lengthened where a motor
    lacks the torque for it."""
    failed_motor: Integer | None = field(None, ge=1, unit="-")
    """Number of a joint, 1..n, whose motor has no torque from the start of the stop on, in category
    1 or 2; its brake closes after its delay. None by default."""
    motors: EachJointOrNone[Text] = field(())
    """Ids of motors whose brakes the joints have, where the device of the scenario names none."""
    catalogue: Annotated[Text, FileOf("motors")] = DEFAULT_CATALOGUE
    """File of these motors, relative to this file's folder, or the name of a shipped file."""
    every: Positive = field(0.05, unit="s")
    """Time between the instants of the motion at which a stop begins; around the worst ones it goes
    down to the interpolation period."""
    longest: Positive = field(60.0, unit="s")
    """Time after which a stop is not simulated further."""
    onset_window: Positive = field(0.1, unit="s")
    """Time over which the onset of G is measured: a step of acceleration has no finite rate."""
    limits: StopLimits = field(StopLimits)
    """Limits of the figures; none by default."""

    def problems(self) -> Problems:
        if self.category == 0 and self.failed_motor is not None:
            yield "failed_motor", "has no effect in category 0, where no motor has power"
        if self.category > 0 and self.deceleration is None:
            yield "deceleration", f"missing, category {self.category} needs it"

    def brakes(self, robot: Robot, device: DeviceChoice) -> Brakes:
        """Return the brakes of a robot: those of the device's motors, or else of `motors`.

        Raises:
            InputError: an unknown motor, or a joint whose motor is not named.
        """
        brakes: list[Brake | None] = []
        names = zip_longest(device.motors, device.fitted, self.motors, fillvalue="")
        ids = [*names] or [("", "", "")] * robot.n
        for k, (chosen, fitted, own) in enumerate(ids):
            if not (chosen or fitted or own):
                text = "missing, expected the id of a motor, as the scenario's device names none"
                raise InputError(f"{text} for joint {k + 1}", place="motors")
            file = device.catalogue if chosen or fitted else self.catalogue
            brakes.append(load_catalogue(file).motor(chosen or fitted or own, "motors").brake)
        return Brakes.of(brakes, robot.gear_ratio)

    def schedule(self, brakes: Brakes, v: Array, longer: float = 1.0) -> Schedule:
        """Return what happens to joints with the speeds v [rad/s] when the stop begins, shape (n,).

        Args:
            brakes: the brakes.
            v: speeds of the joints.
            longer: factor on the duration of the ramps.
        """
        dead = np.arange(1, len(v) + 1) == self.failed_motor
        if self.category == 0 or self.deceleration is None:
            dead[:] = True
            ramp = np.zeros(len(v))
        else:
            ramp = np.where(dead, 0.0, longer * np.abs(v) / np.array(self.deceleration))
        end = float(ramp.max())
        if self.ramp == "coordinated":
            ramp = np.where(dead, 0.0, end)
        closed = end + brakes.delay
        released = np.where(np.isfinite(closed), closed, end)  # the drive holds until then
        if self.category == 2:
            closed = released = np.full(len(v), np.inf)
        return Schedule(ramp, np.where(dead, 0.0, released), np.where(dead, brakes.delay, closed))


def load_stopping(path: str | Path, n: int) -> Stopping:
    """Load the emergency stop of a robot with `n` joints from YAML, or a shipped one by name.

    Raises:
        InputError: with a line for each problem: file, field, and what is accepted.
    """
    stopping, file = load_yaml(Stopping, path, "stops")
    check_joints(stopping, file, n)
    return stopping
