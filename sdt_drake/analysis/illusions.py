"""Illusions that the observer predicts: felt minus true of a motion of the head.

A training motion says in its file which illusion it is meant to give.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from sdt_drake.analysis.orientation import Percept, attitude, perceive
from sdt_drake.analysis.perception import UNPERCEIVED_RATE
from sdt_drake.analysis.threads import threads
from sdt_drake.io.arrays import Array
from sdt_drake.io.resources import find_file, shipped
from sdt_drake.motion import (
    FELT_QUANTITIES,
    IntendedIllusion,
    load_plan,
    load_profile,
    shipped_motions,
)
from sdt_drake.robot.head import HeadMotion, head_motion_of_samples
from sdt_drake.robot.robot import Robot
from sdt_drake.systems.orientation import PERCEPTION, PerceptionModel

LEVELS = dict(zip(FELT_QUANTITIES, (1.7, 1.7, *[UNPERCEIVED_RATE] * 3), strict=True))
"""Errors of feeling that count as an illusion: the threshold of tilts at 0.15 Hz [deg] (Suri &
Clark 2020) and the rotation that goes unperceived [deg/s]."""

PERIOD = 0.02
"""Of planned motions as they are felt [s]."""


@dataclass(frozen=True)
class Illusion:
    """The stretch of a motion with the largest error of feeling of a quantity.

    Attributes:
        quantity: of LEVELS; angles from the true vertical, rates about the head's axes.
        felt, true: at its largest error [deg] or [deg/s].
        at: when that is [s].
        start, end: between which the error is above its level [s].
    """

    quantity: str
    felt: float
    true: float
    at: float
    start: float
    end: float

    @property
    def error(self) -> float:
        """Felt minus true, at its largest [deg] or [deg/s]."""
        return self.felt - self.true

    def __str__(self) -> str:
        unit = unit_of(self.quantity)
        return (
            f"{self.quantity}: felt {self.felt:.1f} {unit} at {self.at:.1f} s where it is "
            f"{self.true:.1f}; wrong from {self.start:.1f} s for {self.end - self.start:.1f} s"
        )


def unit_of(quantity: str) -> str:
    """The unit of a quantity of LEVELS."""
    return "deg/s" if quantity.endswith("rate") else "deg"


def feel(head: HeadMotion, period: float, model: str | PerceptionModel) -> Percept:
    """What is felt of a motion of the head, sampled every `period` [s]."""
    time = period * np.arange(len(head.specific_force), dtype=float)
    return perceive(time, head.specific_force, head.angular_velocity, model)


def true_attitude(head: HeadMotion) -> tuple[Array, Array]:
    """Roll and pitch of the head from the vertical [rad], as of a `Percept`."""
    return attitude(-head.rotation[:, 2])


def quantities(felt: Percept, head: HeadMotion) -> dict[str, tuple[Array, Array]]:
    """Felt and true values of what LEVELS names [deg], [deg/s]."""
    values = {}
    for name, own, true in zip(
        ("roll", "pitch"), (felt.roll, felt.pitch), true_attitude(head), strict=True
    ):
        apart = np.degrees(np.angle(np.exp(1j * (own - true))))  # over the top, too
        values[name] = np.degrees(true) + apart, np.degrees(true)
    for k, name in enumerate(("roll rate", "pitch rate", "yaw rate")):
        values[name] = np.degrees(felt.rate[:, k]), np.degrees(head.angular_velocity[:, k])
    return values


def illusions(felt: Percept, head: HeadMotion) -> list[Illusion]:
    """The largest illusion of each quantity of which there is one."""
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
    """The largest angle between two felt verticals [rad] and difference of felt rates [rad/s]."""
    apart = np.linalg.norm(second.gravity - first.gravity, axis=1)
    rates = np.linalg.norm(second.rate - first.rate, axis=1)
    return float(2 * np.arcsin(np.minimum(apart / 2, 1)).max()), float(rates.max())


@dataclass(frozen=True)
class Intended:
    """The illusion that a motion is meant to give, and what gain sets predict of it.

    Attributes:
        motion: its name.
        quantity: of LEVELS.
        predicted: largest error of feeling in the direction that is meant [deg] or [deg/s], by set.
    """

    motion: str
    quantity: str
    predicted: Mapping[str, float]

    def is_predicted(self, model: str) -> bool:
        """Whether a set predicts it, large enough to be noticed."""
        return abs(self.predicted[model]) > LEVELS[self.quantity]

    def sentence(self, model: str) -> str:
        """What a set predicts of it, in words."""
        unit, error = unit_of(self.quantity), self.predicted[model]
        if self.is_predicted(model):
            return f"{model} predicts it: {self.quantity} felt {error:+.1f} {unit} off."
        return (
            f"{model} does not predict it: {self.quantity} felt at most {abs(error):.1f} {unit} "
            f"off, which is noticed from {LEVELS[self.quantity]:g} {unit} on."
        )


def intended_illusion(motion: str, robot: Robot, models: Sequence[str] = ()) -> Intended | None:
    """Predict the illusion that a motion is meant to give, by default with all sets.

    Returns:
        None for a motion whose file does not say which it is.

    Raises:
        InputError: if the robot cannot do the motion, or has no head.
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
    motion: str, meant: IntendedIllusion, head: HeadMotion, felt: Mapping[str, Percept]
) -> Intended:
    """Hold what is felt of a motion of the head, by gain set, against the illusion meant."""
    errors = {model: largest_error(own, head, meant) for model, own in felt.items()}
    return Intended(motion, meant.quantity, errors)


def intended_illusions(robot: Robot) -> list[Intended]:
    """Predict the illusion of each shipped training motion with all sets."""
    found = [intended_illusion(motion, robot) for motion in shipped_motions()]
    return [one for one in found if one is not None]


def planned_head(motion: str, robot: Robot) -> HeadMotion:
    """The head along a motion as it is planned, by name or file, every PERIOD."""
    planned = load_plan(motion, robot, period=PERIOD).motion
    return head_motion_of_samples(robot, PERIOD, planned.q, planned.v)


def illusion_of(motion: str | Path) -> IntendedIllusion | None:
    """The illusion that a motion is meant to give, by name or file; None if it does not say."""
    file = find_file(motion, "motion")
    return load_profile(file).illusion if file.suffix in (".yaml", ".yml") else None


def largest_error(felt: Percept, head: HeadMotion, meant: IntendedIllusion) -> float:
    """The largest error of feeling of the sign that is meant, 0 if there is none."""
    own, true = quantities(felt, head)[meant.quantity]
    error = (own - true)[(felt.time >= meant.start) & (felt.time <= meant.end)]
    error = error - error[0] * meant.from_start
    size = np.abs(error) if meant.sign == 0 else np.maximum(meant.sign * error, 0)
    return float(error[size.argmax()] * (size.max() > 0))
