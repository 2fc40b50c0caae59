"""Illusions that the observer predicts: felt minus true orientation of the pilot's head.

The file of a training motion names the illusion that it is intended to cause.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from sdt_drake import motion as motions
from sdt_drake.io.arrays import Array
from sdt_drake.io.resources import find_file, shipped
from sdt_drake.pilot.head import HeadMotion, head_motion_of_samples
from sdt_drake.pilot.observer import PERCEPTION, PerceptionModel
from sdt_drake.pilot.orientation import Percept, attitude, perceive
from sdt_drake.pilot.thresholds import UNPERCEIVED_RATE
from sdt_drake.robot.robot import Robot
from sdt_drake.run.threads import threads

LEVELS: dict[str, float] = dict(
    zip(motions.FELT_QUANTITIES, (1.7, 1.7, *[UNPERCEIVED_RATE] * 3), strict=True)
)
"""Smallest errors that count as an illusion, by quantity. Angles: the tilt threshold at 0.15 Hz
(Suri & Clark 2020) [deg]. Rates: the rate of unperceived rotation [deg/s]."""

PERIOD = 0.02
"""Sample period of planned motions for the observer [s]."""


@dataclass(frozen=True)
class Illusion:
    """The largest illusion of one quantity in a motion."""

    quantity: str
    """A key of LEVELS: angle from the true vertical, or rate about an axis of the head."""
    felt: float
    """Felt value at the largest error [deg] or [deg/s]."""
    true: float
    """True value at the largest error [deg] or [deg/s]."""
    at: float
    """Time of the largest error [s]."""
    start: float
    """First time of the stretch around `at` with an error above its level [s]."""
    end: float
    """Last time of that stretch [s]."""

    @property
    def error(self) -> float:
        """Largest felt minus true value [deg] or [deg/s]."""
        return self.felt - self.true

    def __str__(self) -> str:
        unit = unit_of(self.quantity)
        return (
            f"{self.quantity}: felt {self.felt:.1f} {unit}, true {self.true:.1f} {unit} at "
            f"{self.at:.1f} s; illusion from {self.start:.1f} to {self.end:.1f} s"
        )


def unit_of(quantity: str) -> str:
    """Return the unit of a quantity of LEVELS."""
    return "deg/s" if quantity.endswith("rate") else "deg"


def feel(head: HeadMotion, period: float, model: str | PerceptionModel) -> Percept:
    """Return the percept of a head motion that is sampled every `period` [s]."""
    time = period * np.arange(len(head.specific_force), dtype=float)
    return perceive(time, head.specific_force, head.angular_velocity, model)


def true_attitude(head: HeadMotion) -> tuple[Array, Array]:
    """Return true roll and pitch of the head [rad], with the signs of a `Percept`."""
    return attitude(-head.rotation[:, 2])


def quantities(felt: Percept, head: HeadMotion) -> dict[str, tuple[Array, Array]]:
    """Return felt and true values by quantity of LEVELS [deg], [deg/s]."""
    values = {}
    for name, own, true in zip(
        ("roll", "pitch"), (felt.roll, felt.pitch), true_attitude(head), strict=True
    ):
        apart = np.degrees(np.angle(np.exp(1j * (own - true))))  # also across 180 deg
        values[name] = np.degrees(true) + apart, np.degrees(true)
    for k, name in enumerate(("roll rate", "pitch rate", "yaw rate")):
        values[name] = np.degrees(felt.rate[:, k]), np.degrees(head.angular_velocity[:, k])
    return values


def illusions(felt: Percept, head: HeadMotion) -> list[Illusion]:
    """Return the largest illusion of each quantity whose error exceeds its level."""
    found = []
    for name, (own, true) in quantities(felt, head).items():
        error = np.abs(own - true)
        i = int(error.argmax())
        if error[i] > LEVELS[name]:
            below = np.flatnonzero(error <= LEVELS[name])
            start = below[below < i].max(initial=-1) + 1
            end = below[below > i].min(initial=len(error)) - 1
            at = felt.time[[i, start, end]]
            found.append(Illusion(name, float(own[i]), float(true[i]), *map(float, at)))
    return found


def felt_apart(first: Percept, second: Percept) -> tuple[float, float]:
    """Return largest angle between felt verticals [rad] and difference of felt rates [rad/s]."""
    apart = np.linalg.norm(second.gravity - first.gravity, axis=1)
    rates = np.linalg.norm(second.rate - first.rate, axis=1)
    return float(2 * np.arcsin(np.minimum(apart / 2, 1)).max()), float(rates.max())


@dataclass(frozen=True)
class Value:
    """The largest value of an intended illusion, in its direction."""

    size: float
    """Value [deg] or [deg/s]; 0 if there is none in the intended direction."""
    start: float = np.nan
    """First time in the interval of the illusion with a value above its level [s], or NaN."""
    end: float = np.nan
    """Last such time [s], or NaN."""


@dataclass(frozen=True)
class Intended:
    """The intended illusion of a motion, and its predictions by parameter set."""

    motion: str
    """Name of the motion."""
    meant: motions.IntendedIllusion
    """The illusion that the motion should give."""
    predicted: Mapping[str, Value]
    """Largest value in the intended direction by parameter set."""
    force_alone: Value
    """The value of a pilot without canals: the force is down, and no rotation is felt."""

    @property
    def quantity(self) -> str:
        """A key of LEVELS."""
        return self.meant.quantity

    @property
    def needs_canals(self) -> bool:
        """True if a pilot without canals does not have the illusion."""
        return abs(self.force_alone.size) <= LEVELS[self.quantity]

    def is_felt(self, model: str) -> bool:
        """Return whether the value of a parameter set is above its level."""
        return abs(self.predicted[model].size) > LEVELS[self.quantity]

    def is_predicted(self, model: str) -> bool:
        """Return whether a parameter set has the illusion, and a pilot without canals has not."""
        return self.needs_canals and self.is_felt(model)

    def sentence(self, model: str) -> str:
        """Return the prediction of a parameter set as a sentence, with its time."""
        unit, own = unit_of(self.quantity), self.predicted[model]
        off = " off" if self.meant.of == "error" else ""
        if not self.is_felt(model):
            return (
                f"{model} does not predict the illusion: {self.quantity} felt at most "
                f"{abs(own.size):.1f} {unit}{off}, noticed from {LEVELS[self.quantity]:g} {unit} "
                "on."
            )
        felt = (
            f"{self.quantity} felt {own.size:+.1f} {unit}{off}, from {own.start:.1f} to "
            f"{own.end:.1f} s"
        )
        if self.needs_canals:
            return f"{model} predicts the illusion: {felt}."
        return (
            f"{model} has the illusion ({felt}), but so has a pilot without canals "
            f"({self.force_alone.size:+.1f} {unit}): the force alone explains it."
        )


def intended_illusion(motion: str, robot: Robot, models: Sequence[str] = ()) -> Intended | None:
    """Predict the intended illusion of a motion.

    Args:
        motion: name or file of the motion.
        robot: the robot that flies it.
        models: parameter sets; all shipped ones by default.

    Returns:
        The prediction; None for a motion whose file names no illusion.

    Raises:
        InputError: the robot cannot follow the motion, or has no head.
    """
    meant = illusion_of(motion)
    if meant is None:
        return None
    models = models or tuple(shipped(PERCEPTION))
    head = planned_head(motion, robot)
    with threads(2) as pool:
        felt = dict(zip(models, pool.map(partial(feel, head, PERIOD), models), strict=True))
    return intended(motion, meant, head, felt)


def intended(
    motion: str, meant: motions.IntendedIllusion, head: HeadMotion, felt: Mapping[str, Percept]
) -> Intended:
    """Return the intended illusion of a motion, from the percept of each parameter set."""
    values = {model: largest_value(own, head, meant) for model, own in felt.items()}
    without = force_alone(next(iter(felt.values())))
    return Intended(motion, meant, values, largest_value(without, head, meant))


def force_alone(felt: Percept) -> Percept:
    """Return the percept of a pilot without canals: the force is down, and no rotation is felt."""
    size = np.linalg.norm(felt.specific_force, axis=1, keepdims=True)
    still = np.zeros_like(felt.rate)
    down = -felt.specific_force / size
    return replace(felt, gravity=down, rate=still, acceleration=still)


def intended_illusions(robot: Robot) -> list[Intended]:
    """Predict the illusion of each shipped training motion with all shipped parameter sets."""
    found = [intended_illusion(motion, robot) for motion in motions.shipped_motions()]
    return [one for one in found if one is not None]


def planned_head(motion: str, robot: Robot) -> HeadMotion:
    """Return the head motion of a planned motion (name or file), sampled every PERIOD."""
    planned = motions.load_plan(motion, robot, period=PERIOD).motion
    return head_motion_of_samples(robot, PERIOD, planned.q, planned.v)


def illusion_of(motion: str | Path) -> motions.IntendedIllusion | None:
    """Return the intended illusion of a motion (name or file); None if its file names none."""
    file = find_file(motion, "motion")
    return motions.load_profile(file).illusion if file.suffix in (".yaml", ".yml") else None


def largest_value(felt: Percept, head: HeadMotion, meant: motions.IntendedIllusion) -> Value:
    """Return the largest value of an illusion in its direction; 0 if there is none."""
    own, true = quantities(felt, head)[meant.quantity]
    value = own - true if meant.of == "error" else own
    if meant.zero_at is not None:
        value = value - np.interp(meant.zero_at, felt.time, value)
    inside = (felt.time >= meant.start) & (felt.time <= meant.end)
    time, value = felt.time[inside], value[inside]
    size = np.abs(value) if meant.sign == 0 else np.maximum(meant.sign * value, 0)
    above = time[size > LEVELS[meant.quantity]]
    times = (float(above[0]), float(above[-1])) if len(above) else ()
    return Value(float(value[size.argmax()] * (size.max() > 0)), *times)
