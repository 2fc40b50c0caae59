"""Illusions that the observer predicts: what is felt of a motion of the head, less what is true.

What the shipped training motions are meant to feel like stands in illusions.yaml.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.analysis.orientation import Percept, attitude, perceive
from sdt_drake.analysis.perception import UNPERCEIVED_RATE
from sdt_drake.analysis.threads import threads
from sdt_drake.io.arrays import Array
from sdt_drake.io.resources import shipped
from sdt_drake.io.yaml_files import read_yaml
from sdt_drake.motion import load_plan
from sdt_drake.robot.head import HeadMotion, head_motion_of_samples
from sdt_drake.robot.robot import Robot
from sdt_drake.systems.orientation import PERCEPTION, PerceptionModel

LEVELS = {
    "roll": 1.7,
    "pitch": 1.7,
    "roll rate": UNPERCEIVED_RATE,
    "pitch rate": UNPERCEIVED_RATE,
    "yaw rate": UNPERCEIVED_RATE,
}
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
        unit = "deg/s" if self.quantity.endswith("rate") else "deg"
        return (
            f"{self.quantity}: felt {self.felt:.1f} {unit} at {self.at:.1f} s where it is "
            f"{self.true:.1f}; wrong from {self.start:.1f} s for {self.end - self.start:.1f} s"
        )


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
    """The illusion that a training motion is meant to give, and what gain sets predict of it.

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


def intended_illusions(robot: Robot, models: Sequence[str] = ()) -> list[Intended]:
    """Predict of each training motion the illusion that is meant, by default with all sets."""
    models = models or tuple(shipped(PERCEPTION))
    found = []
    for motion, meant in _texts().items():
        head = planned_head(motion, robot)
        with threads(2) as pool:
            felt = list(pool.map(partial(feel, head, PERIOD), models))
        errors = [largest_error(one, head, **meant) for one in felt]
        found.append(Intended(motion, meant["quantity"], dict(zip(models, errors, strict=True))))
    return found


def planned_head(motion: str, robot: Robot) -> HeadMotion:
    """The head along a motion as it is planned, by name or file, every PERIOD."""
    planned = load_plan(motion, robot, period=PERIOD).motion
    return head_motion_of_samples(robot, PERIOD, planned.q, planned.v)


def meant_of(motion: str) -> Mapping[str, Any] | None:
    """What a training motion is meant to feel like, as `largest_error` takes it; None of others."""
    meant: Mapping[str, Any] | None = _texts().get(motion)
    return meant


@cache
def _texts() -> Any:
    return read_yaml(Path(__file__).with_name("illusions.yaml"))


def largest_error(
    felt: Percept,
    head: HeadMotion,
    quantity: str,
    sign: int,
    between: Sequence[float],
    since_start: bool = False,
) -> float:
    """The largest error of feeling of that sign, 0 if there is none; see illusions.yaml."""
    start, end = between
    own, true = quantities(felt, head)[quantity]
    error = (own - true)[(felt.time >= start) & (felt.time <= end)]
    error = error - error[0] * since_start
    meant = np.abs(error) if sign == 0 else np.maximum(sign * error, 0)
    return float(error[meant.argmax()] * (meant.max() > 0))
