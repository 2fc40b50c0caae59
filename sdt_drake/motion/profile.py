"""What the instructor wants: the commanded speed of each joint over time, from YAML."""

# Drake's YAML loader reads the annotations here: they may not be postponed, and a union must be
# spelled Optional[...] or Union[...].
import itertools
from dataclasses import dataclass, field
from pathlib import Path
from typing import Optional, Union

import numpy as np
from numpy.typing import NDArray

from sdt_drake.errors import InputError, checked_number, checked_vector, whole_periods
from sdt_drake.yaml_files import load_yaml

Array = NDArray[np.float64]

_MOST_SWINGS = 100_000  # what memory holds


@dataclass
class Knots:
    """Piecewise-linear speed.

    Attributes:
        knots: pairs of time [s] and joint speed [rad/s]; times grow from 0 to the duration.
    """

    knots: list[list[float]] = field(default_factory=list)

    def validate(self, duration: float, where: str) -> None:
        """Raise InputError unless the knots cover 0..duration [s] in growing time."""
        if len(self.knots) < 2 or any(len(knot) != 2 for knot in self.knots):
            raise InputError(f"{where}.knots: expected at least two pairs [time s, speed rad/s]")
        checked_vector(np.ravel(self.knots), 2 * len(self.knots), f"{where}.knots")
        times = [knot[0] for knot in self.knots]
        for earlier, later in itertools.pairwise(times):
            if later <= earlier:
                raise InputError(
                    f"{where}.knots: time {later:g} s after {earlier:g} s, expected growing times"
                )
        if times[0] != 0 or times[-1] != duration:
            raise InputError(
                f"{where}.knots: from {times[0]:.9g} to {times[-1]:.9g} s, "
                f"expected 0 to {duration:g} s"
            )

    def speed(self, time: Array) -> Array:
        """Joint speed [rad/s] at `time` [s]."""
        times, speeds = np.transpose(self.knots)
        return np.interp(time, times, speeds)

    def corners(self) -> Array:
        """Times of the knots [s]."""
        return np.array(self.knots)[:, 0]


@dataclass
class Sampled:
    """Speed given at equal steps, linear between them.

    Attributes:
        period: time between samples [s].
        speeds: joint speed [rad/s] at 0, period, 2 period, ... up to the duration.
    """

    period: float = 0.0
    speeds: list[float] = field(default_factory=list)

    def validate(self, duration: float, where: str) -> None:
        """Raise InputError unless the samples cover 0..duration [s]."""
        checked_number(self.period, f"{where}.period", minimum=0, exclusive=True)
        count = whole_periods(duration, self.period, f"{where}: duration")
        if len(self.speeds) != count + 1:
            raise InputError(
                f"{where}.speeds: {len(self.speeds)} samples, expected {count + 1} "
                f"for {duration:g} s at {self.period:g} s"
            )
        checked_vector(self.speeds, count + 1, f"{where}.speeds")

    def speed(self, time: Array) -> Array:
        """Joint speed [rad/s] at `time` [s]."""
        return np.interp(time, self.corners(), self.speeds)

    def corners(self) -> Array:
        """Times of the samples [s]."""
        return self.period * np.arange(len(self.speeds))


@dataclass
class Oscillation:
    """Speed of a swing A sin(2 pi t / T) that is faded in and out.

    v(t) = A (2 pi / T) cos(2 pi t / T) clip(t / fade, 0, 1) clip((end - t) / fade, 0, 1)

    Attributes:
        amplitude: A, of the angle [rad].
        period: T [s].
        fade: time to full swing, and to rest [s].
        end: time of rest [s].
    """

    amplitude: float = 0.0
    period: float = 0.0
    fade: float = 0.0
    end: float = 0.0

    def validate(self, duration: float, where: str) -> None:
        """Raise InputError unless the swing is finite and over by `duration` [s]."""
        checked_number(self.amplitude, f"{where}.amplitude")
        for name in ("period", "fade", "end"):
            checked_number(getattr(self, name), f"{where}.{name}", minimum=0, exclusive=True)
        shortest = self.end / _MOST_SWINGS
        if self.period < shortest:
            raise InputError(
                f"{where}.period: {self.period:g} s, expected at least {shortest:g} s, "
                f"for {_MOST_SWINGS} swings by {self.end:g} s"
            )
        if self.end > duration:
            raise InputError(f"{where}.end: {self.end:g} s, expected <= duration {duration:g} s")

    def speed(self, time: Array) -> Array:
        """Joint speed [rad/s] at `time` [s]."""
        omega = 2 * np.pi / self.period
        fade_in = np.clip(time / self.fade, 0, 1)
        fade_out = np.clip((self.end - time) / self.fade, 0, 1)
        return self.amplitude * omega * np.cos(omega * time) * fade_in * fade_out

    def corners(self) -> Array:
        """Times of the turns of the speed, and where the fading starts or ends [s]."""
        turns = np.arange(0, self.end, self.period / 2)
        fading = np.array([self.fade, self.end - self.fade, self.end])
        return np.concatenate([turns, np.clip(fading, 0, self.end)])


@dataclass
class CommandProfile:
    """Commanded speeds of all joints.

    Attributes:
        name: short name.
        description: one sentence for lists and reports.
        duration: [s].
        q0: joint angles at the start [rad]; all 0 if not given.
        joints: the speed of each joint, base to tip.
    """

    name: str = ""
    description: str = ""
    duration: float = 0.0
    q0: Optional[list[float]] = None
    joints: list[Union[Knots, Sampled, Oscillation]] = field(default_factory=list)

    def validate(self, where: str) -> None:
        """Raise InputError, naming `where` and the field, unless every joint is sound."""
        checked_number(self.duration, f"{where}: duration", minimum=0, exclusive=True)
        if not self.joints:
            raise InputError(f"{where}: joints: empty, expected one entry for each joint")
        for k, joint in enumerate(self.joints):
            joint.validate(self.duration, f"{where}: joints[{k + 1}]")
        if self.q0 is not None:
            checked_vector(self.q0, len(self.joints), f"{where}: q0")

    def start(self) -> Array:
        """Joint angles at time 0 [rad], shape (n,)."""
        return np.zeros(len(self.joints)) if self.q0 is None else np.array(self.q0)

    def speeds(self, time: Array) -> Array:
        """Commanded joint speeds [rad/s] at `time` [s] of shape (N,), shape (N, n)."""
        return np.stack([joint.speed(time) for joint in self.joints], axis=1)

    def corners(self) -> Array:
        """Times [s] between which every speed goes one way, growing."""
        return np.unique(np.concatenate([joint.corners() for joint in self.joints]))


def load_profile(path: str | Path) -> CommandProfile:
    """A command profile from YAML.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    profile, file = load_yaml(CommandProfile, path)
    profile.name = profile.name or file.stem
    profile.validate(str(file))
    return profile
