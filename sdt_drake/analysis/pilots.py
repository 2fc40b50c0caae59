"""Pilots who differ as far as people were reported to, and how many of them feel an illusion.

How people differ stands in pilots.yaml, with sources.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.analysis.illusions import LEVELS, feel, largest_error
from sdt_drake.analysis.threads import threads
from sdt_drake.io.arrays import Array
from sdt_drake.io.progress import with_progress
from sdt_drake.io.yaml_files import read_yaml
from sdt_drake.motion import IntendedIllusion
from sdt_drake.robot.head import HeadMotion
from sdt_drake.systems.orientation import PerceptionModel, load_perception


@dataclass(frozen=True)
class Feeling:
    """How many pilots are predicted to feel an illusion.

    Attributes:
        quantity: of LEVELS.
        errors: largest error of feeling of each pilot [deg] or [deg/s], shape (N,).
    """

    quantity: str
    errors: Array

    @property
    def count(self) -> int:
        """How many feel more than what counts as an illusion."""
        return int((np.abs(self.errors) > LEVELS[self.quantity]).sum())

    def __str__(self) -> str:
        from scipy.stats import binomtest

        count, of = self.count, len(self.errors)
        interval = binomtest(count, of).proportion_ci(method="wilson")
        share, low, high = (f"{100 * x:.0f}" for x in (count / of, interval.low, interval.high))
        return f"{count} of {of} pilots ({share} %, 95 % interval {low} to {high} %)"


def draw_pilots(model: PerceptionModel, count: int, seed: int = 0) -> list[PerceptionModel]:
    """Pilots around a gain set; the same for a seed, and the first ones of any larger count."""
    return [_pilot(model, np.random.default_rng([seed, k])) for k in range(count)]


def _pilot(model: PerceptionModel, random: np.random.Generator) -> PerceptionModel:
    """Felt yaw lasts (k_w + 1) tau, but for adaptation: what is drawn of it makes k_w about z."""
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
    """Count the pilots who are predicted to feel an illusion.

    Args:
        meant: the illusion; None for an error of any quantity, at any time.
        head: motion of the head, sampled every `period` [s].
        model: gain set that pilots are drawn around.
        count: of pilots.
        seed: of what is drawn.
    """
    end = period * len(head.specific_force)
    always = [IntendedIllusion(quantity=own, sign=0, start=0, end=end) for own in LEVELS]
    sought = always if meant is None else [meant]

    def errors(pilot: PerceptionModel) -> list[float]:
        felt = feel(head, period, pilot)
        return [largest_error(felt, head, one) for one in sought]

    pilots = draw_pilots(load_perception(model), count, seed)
    with threads(2) as pool:  # Drake steps without the interpreter's lock
        rows = list(with_progress(pool.map(errors, pilots), count))
    columns = np.array(rows).T
    return [Feeling(one.quantity, own) for one, own in zip(sought, columns, strict=True)]


def differences() -> list[str]:
    """How the pilots differ and how they do not, with sources, in sentences."""
    people = _people()
    told = [f"Pilots differ in {people[k]['changes']}: {people[k]['source']}." for k in _DRAWN]
    return [*told, f"No spread was found of {people['same_for_all']}: these are the set's own."]


_DRAWN = ("cupula", "yaw")


@cache
def _people() -> Any:
    return read_yaml(Path(__file__).with_name("pilots.yaml"))
