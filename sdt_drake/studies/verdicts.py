"""Verdicts of a sizing: the motors that meet the requirements, for each controller."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sdt_drake.analysis.metrics import family_of, metric_of
from sdt_drake.io.arrays import Mask
from sdt_drake.studies.sizing import Candidate, Sizing, candidates, short_name
from sdt_drake.studies.table import ANSWERS, STATUSES, StudyTable, pandas, pareto

if TYPE_CHECKING:
    import pandas as pd

_DECIMALS = 3  # decimals of a speed error [rad/s]; the accuracy of a study
_ROUND_OFF = 1e-9  # allowed excess of an outcome: the planner uses limits fully


@dataclass(frozen=True)
class Verdict:
    """The verdict on a candidate with a controller, over all motions."""

    candidate: Candidate
    """The motor set and its structure."""
    controller: str
    """Label of the controller."""
    mass: float
    """Mass of the motors of all joints [kg]."""
    error: float
    """Largest speed error of any joint in any motion [rad/s]; NaN if a run is missing."""
    worst: dict[str, tuple[float, str]]
    """Largest value of each required outcome, and the motion in which it occurs."""
    used: dict[str, float]
    """Largest value of each outcome over its limit [-]; inf if a limit of 0 is exceeded."""
    missed: tuple[str, ...]
    """Texts of the requirements that are not met, the most important first."""
    beyond: tuple[str, ...]
    """Names of the outcomes beyond their limits, and of motions that cannot be done."""
    judged: bool
    """True if every motion has a result: a run that is ok or infeasible."""

    @property
    def feasible(self) -> bool:
        """True if all requirements are met."""
        return not self.missed

    def tightest(self, joint: int) -> str:
        """Return the name of the outcome nearest to its limit; joints are counted from 1."""
        own = {name: share for name, share in self.used.items() if family_of(name)[1] == joint}
        return max(own, key=own.__getitem__)


def judge_candidates(sizing: Sizing, table: StudyTable) -> list[Verdict]:
    """Compare every candidate with the requirements, over all motions and for each controller.

    Args:
        sizing: the sizing that was run.
        table: runs of `sizing.study()`; some may be missing.
    """
    motors = {f"motor_{k + 1}": ids for k, ids in enumerate(sizing.motors)}
    levels: dict[str, Sequence[object]] = {"controller": sizing.controllers, **motors}
    levels |= {"structure_scale": sizing.structure_scales, "motion": sizing.motions}
    every = pandas().MultiIndex.from_product(levels.values(), names=levels)
    runs = table.runs.assign(error=table.outcome("max_abs_speed_error")).set_index([*levels])
    rows = iter(runs.reindex(every).to_dict("records"))
    motions = [short_name(motion) for motion in sizing.motions]
    return [
        _verdict(sizing, candidate, controller, dict(zip(motions, rows, strict=False)))
        for controller in sizing.controllers
        for candidate in candidates(sizing)
    ]


def _verdict(
    sizing: Sizing, candidate: Candidate, controller: str, runs: Mapping[str, Mapping[str, Any]]
) -> Verdict:
    """Return the verdict from the runs of a candidate with a controller, by motion."""
    ran = {motion: run for motion, run in runs.items() if run["status"] == "ok"}
    missed, beyond = [], []
    for motion, run in runs.items():
        if run["status"] not in STATUSES:
            missed.append(f"{motion} has not been run")
        elif motion not in ran:
            status = run["status"].replace("_", " ")
            missed.append(f"{motion} is {status}: {run['reason']}")
            beyond.append(f"{motion}, which is {status}")
    worst: dict[str, tuple[float, str]] = {}
    for name, limit in sizing.limits.items() if ran else ():
        values = {motion: run[name] for motion, run in ran.items()}
        motion = max(values, key=lambda m: (math.isnan(values[m]), values[m]))
        worst[name] = values[motion], motion
        if not values[motion] <= limit + _ROUND_OFF:  # true for NaN, too
            missed.append(_missed(name, *worst[name], limit))
            beyond.append(name)
    used = {}
    for name, (value, _) in worst.items():
        limit = sizing.limits[name]
        used[name] = value / limit if limit > 0 else 0.0 if value <= 0 else math.inf
    return Verdict(
        candidate=candidate,
        controller=controller,
        mass=math.fsum(map(sizing.masses.__getitem__, candidate.motors)),  # exact in any order
        error=max(run["error"] for run in ran.values()) if len(ran) == len(runs) else math.nan,
        worst=worst,
        used=used,
        missed=tuple(missed),
        beyond=tuple(beyond),
        judged=all(run["status"] in ANSWERS for run in runs.values()),
    )


def _missed(name: str, value: float, motion: str, limit: float) -> str:
    metric, joint = metric_of(name), family_of(name)[1]
    of_joint = f" of joint {joint}" if joint else ""
    number, most = (f"{metric.factor * x:.4g}" for x in (value, limit))
    return f"{metric.title}{of_joint} is {number} {metric.unit} in {motion}, allowed is {most}"


# --- recommendations -------------------------------------------------------------------------


def front_of(verdicts: Sequence[Verdict]) -> Mask:
    """Return the mask of verdicts on the Pareto front of motor mass and speed error, shape (N,).

    Each controller has its own front, of the candidates that meet all requirements with it. Errors
    are rounded to 0.001 rad/s, the accuracy of a study.
    """
    mass = np.array([v.mass for v in verdicts])
    errors = np.round([v.error if v.feasible else math.nan for v in verdicts], _DECIMALS)
    labels = np.array([v.controller for v in verdicts])
    front = np.zeros(len(verdicts), dtype=bool)
    for own in (labels == label for label in np.unique(labels)):
        front[own] = pareto(mass[own], errors[own])
    return front


def recommend(verdicts: Sequence[Verdict], controller: str) -> Verdict | None:
    """Return the lightest motor set that meets all requirements with a controller; None if none.

    Among equally light ones the lightest structure is preferred, then the smallest error.
    """
    return min(
        (v for v in verdicts if v.controller == controller and v.feasible),
        key=lambda v: (v.mass, v.candidate.structure_scale, v.error),
        default=None,
    )


def nearest(verdicts: Sequence[Verdict], controller: str) -> Verdict:
    """Return the candidate that misses the fewest requirements; among several the lightest.

    Judged candidates are preferred, and among them those that can do all motions: without a
    motion, most requirements are not tested.
    """

    def distance(v: Verdict) -> tuple[float, ...]:
        cannot = math.isnan(v.error)
        return not v.judged, cannot, len(v.missed), v.mass, v.candidate.structure_scale

    return min((v for v in verdicts if v.controller == controller), key=distance)


def verdict_table(verdicts: Sequence[Verdict]) -> pd.DataFrame:
    """Return the verdicts as a table, a candidate with a controller in each row.

    Columns are the controller, the candidate (`motor_k`, `structure_scale`), `motor_mass` of all
    joints [kg], `front` (see `front_of`), the worst value of each required outcome over all
    motions, in the units of `StudyTable.runs`, and `missed`, the requirements that are not met.
    """
    rows = [
        {
            "controller": v.controller,
            **{f"motor_{k + 1}": id_ for k, id_ in enumerate(v.candidate.motors)},
            "structure_scale": v.candidate.structure_scale,
            "motor_mass": v.mass,
            "front": front,
            **{name: value for name, (value, _) in v.worst.items()},
            "missed": "; ".join(v.missed),
        }
        for v, front in zip(verdicts, front_of(verdicts), strict=True)
    ]
    found = pandas().DataFrame(rows)
    return found[[name for name in found if name != "missed"] + ["missed"]]
