"""Populations of pilots with reported variability, and the share that feels an illusion.

The variability, with sources, is in pilots.yaml.
"""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.progress import with_progress
from sdt_drake.io.yaml_files import read_yaml
from sdt_drake.motion import FELT_QUANTITIES, IntendedIllusion
from sdt_drake.pilot.head import HeadMotion
from sdt_drake.pilot.illusions import LEVELS, feel, largest_value
from sdt_drake.pilot.observer import PerceptionModel, load_perception
from sdt_drake.run.threads import threads


@dataclass(frozen=True, eq=False)
class Feeling:
    """The predicted illusion of each pilot of a population."""

    quantity: str
    """A key of LEVELS."""
    errors: Array
    """Largest felt minus true value of each pilot [deg] or [deg/s], shape (N,)."""

    @property
    def count(self) -> int:
        """Number of pilots with an error above the level of LEVELS."""
        return int((np.abs(self.errors) > LEVELS[self.quantity]).sum())

    def __str__(self) -> str:
        from scipy.stats import binomtest

        count, of = self.count, len(self.errors)
        interval = binomtest(count, of).proportion_ci(method="wilson")
        share, low, high = (f"{100 * x:.0f}" for x in (count / of, interval.low, interval.high))
        return f"{count} of {of} pilots ({share} %, 95 % interval {low} to {high} %)"


def draw_pilots(model: PerceptionModel, count: int, seed: int = 0) -> list[PerceptionModel]:
    """Return random pilots around a parameter set.

    The same seed gives the same pilots; a larger count continues the list.
    """
    return [_pilot(model, np.random.default_rng([seed, k])) for k in range(count)]


def _pilot(model: PerceptionModel, random: np.random.Generator) -> PerceptionModel:
    """Return one random pilot.

    Felt yaw lasts about (k_w + 1) tau (without adaptation); k_w about z follows from its random
    duration.
    """
    people = _people()
    cupula, (low, high) = people["cupula"], people["yaw"]["range"]
    slowness = random.normal(1, cupula["deviation"] / cupula["mean"])
    lasting = 2 * random.uniform(low, high) / (low + high)
    k_w = (model.k_w[2] + 1) * lasting / slowness - 1
    return replace(
        model, k_w=[*model.k_w[:2], k_w], tau=[slowness * own for own in model.tau]
    )  # fmt: skip


def feelings(
    meant: IntendedIllusion | None,
    head: HeadMotion,
    period: float,
    model: str,
    count: int,
    seed: int = 0,
) -> list[Feeling]:
    """Predict the illusions of a population of pilots.

    Args:
        meant: the intended illusion; None for errors of any quantity at any time.
        head: motion of the head.
        period: its sample period [s].
        model: parameter set around which pilots are drawn.
        count: number of pilots.
        seed: seed of the random draw.
    """
    end = period * len(head.specific_force)
    always = [IntendedIllusion(quantity=own, sign=0, start=0, end=end) for own in FELT_QUANTITIES]
    sought = always if meant is None else [meant]

    def errors(pilot: PerceptionModel) -> list[float]:
        felt = feel(head, period, pilot)
        return [largest_value(felt, head, one).size for one in sought]

    pilots = draw_pilots(load_perception(model), count, seed)
    with threads(2) as pool:  # Drake steps without the interpreter lock
        rows = list(with_progress(pool.map(errors, pilots), count))
    columns = np.array(rows).T
    return [Feeling(one.quantity, own) for one, own in zip(sought, columns, strict=True)]


def differences() -> list[str]:
    """Return sentences on the parameters that differ between pilots, and those that do not."""
    people = _people()
    drawn = [f"Pilots differ in {people[k]['changes']}: {people[k]['source']}." for k in _DRAWN]
    return [
        *drawn,
        f"No spread was found of {people['same_for_all']}: all pilots have the set's own.",
    ]


_DRAWN = ("cupula", "yaw")


@cache
def _people() -> Any:
    """Return the content of pilots.yaml."""
    return read_yaml(Path(__file__).with_name("pilots.yaml"))
