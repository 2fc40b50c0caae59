"""How stiff a structure has to be: the speed loops against an elastic joint.

The paper chooses omega_n = 0.5 omega_r, citing a rule of thumb. Here the rule is tried: each axis
of the device becomes two masses, rotor and link, with a spring that gives the locked-rotor
frequency omega_r, under the PI controller that `tune` gives for omega_n = ratio * omega_r.

Each axis stands alone, with its largest inertia. On the coupled plant a smaller inertia, or what
the other joints do, can bring the border down where speed is measured on the link: `simulate` with
`plant.elasticity` shows it.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sdt_drake.analysis.linear import (
    StateSpace,
    close,
    linear_feedback,
    linear_process,
)
from sdt_drake.control import damping_ratio as damping_ratio_of
from sdt_drake.control import tune
from sdt_drake.design import Design
from sdt_drake.device import Drive, Elasticity
from sdt_drake.errors import checked_number, checked_vector
from sdt_drake.scenario import ControllerChoice

Array = NDArray[np.float64]

SLOWEST = 0.1
"""Least omega_r of a sweep [rad/s]: slower than that is round-off of a sampled loop."""

RATIOS = np.round(np.arange(0.1, 1.5001, 0.05), 10)
"""omega_n / omega_r."""


@dataclass(frozen=True, eq=False)
class StabilitySweep:
    """Loops of n joints with elastic joints, over omega_n / omega_r; arrays (len(ratio), n).

    Attributes:
        ratio: omega_n / omega_r [-], shape (len(ratio),).
        damping: smallest damping ratio of any mode of the loop; below 0 it is unstable [-].
        overshoot_percent: of the link's speed after a step of its reference [%]; NaN if unstable.
        border: smallest ratio from which on the loop is unstable, to 1e-3, shape (n,); inf if it is
            stable to the last ratio.
    """

    ratio: Array
    damping: Array
    overshoot_percent: Array
    border: Array


def stability_sweep(
    design: Design,
    omega_r: float,
    *,
    encoder: str = "motor",
    drive: Drive | None = None,
    ratios: ArrayLike = RATIOS,
    damping_ratio: float = 0.01,
) -> StabilitySweep:
    """Sweep omega_n / omega_r on every axis of a robot, each on its own with its largest inertia.

    Args:
        design: gives the robot, its inertia, and the damping ratios of its speed loops.
        omega_r: locked-rotor frequency of each elastic joint [rad/s].
        encoder: where speed is measured, "motor" or "link".
        drive: of the motors; ideal by default. Its delay of the reference does not matter here.
        ratios: omega_n / omega_r [-], growing.
        damping_ratio: of the elastic joints [-].

    Raises:
        InputError: for values out of range, or a robot without rotor inertia.
    """
    ratios = np.atleast_1d(np.asarray(ratios, dtype=float))
    checked_vector(ratios, len(ratios), "ratios", positive=True)
    checked_number(omega_r, "omega_r", minimum=SLOWEST)
    elastic = _elastic_design(design, omega_r, encoder, drive, damping_ratio)
    process = linear_process(elastic)

    def axes(ratio: float) -> list[StateSpace]:
        loop = close(elastic, process, linear_feedback(_tuned(elastic, ratio * omega_r)))
        return [loop.closed(k) for k in range(design.robot.n)]

    shape = len(ratios), design.robot.n
    damping, overshoot = np.empty(shape), np.full(shape, np.nan)
    for i, ratio in enumerate(ratios):
        for k, closed in enumerate(axes(ratio)):
            damping[i, k] = least_damping(closed, ratio * omega_r)
            if damping[i, k] > 0:
                _, speed = closed.step(_SHOWN / (ratio * omega_r), _STEPS)
                overshoot[i, k] = 100 * max(speed.max() - 1, 0.0)
    border = [
        _border(
            lambda ratio, k=k: least_damping(axes(ratio)[k], ratio * omega_r), ratios, damping[:, k]
        )
        for k in range(design.robot.n)
    ]
    return StabilitySweep(ratios, damping, overshoot, np.array(border))


_SHOWN, _STEPS = 20.0, 1000  # of a step response: 1 / omega_n, and samples of a continuous loop


def least_damping(loop: StateSpace, omega_n: float) -> float:
    """Smallest damping ratio -Re(s) / |s| of all modes of a loop with that omega_n [-].

    A free position neither decays nor grows; what is 1e4 times slower than the loop is one, with
    its round-off.
    """
    modes = loop.modes()
    moving = modes[np.abs(modes) > 1e-4 * omega_n]
    return float(np.min(-moving.real / np.abs(moving)))


def _elastic_design(
    design: Design, omega_r: float, encoder: str, drive: Drive | None, damping_ratio: float
) -> Design:
    """The axes of a design with elastic joints and a PI controller."""
    scenario = copy.deepcopy(design.scenario)
    scenario.plant.kind = "axis"
    scenario.plant.i_eff = design.inertia.maximum.tolist()
    scenario.plant.friction = None
    scenario.plant.elasticity = Elasticity([omega_r] * design.robot.n, damping_ratio, encoder)
    scenario.drive = drive
    scenario.controller = ControllerChoice(
        structure=design.scenario.controller.structure,
        omega_r=1.0,  # tuned for each ratio, below
        zeta=damping_ratio_of(design.gains, design.inertia.maximum).tolist(),
    )
    return design.variant(scenario)


def _tuned(elastic: Design, omega_n: float) -> Design:
    inertia = elastic.inertia.maximum
    zeta = damping_ratio_of(elastic.gains, inertia)
    return replace(elastic, gains=tune(inertia, 2 * omega_n, zeta))


def _border(damping_at: Callable[[float], float], ratios: Array, damping: Array) -> float:
    """Where the damping first falls below 0, by bisection."""
    unstable = np.flatnonzero(damping < 0)
    if len(unstable) == 0:
        return float("inf")
    first = int(unstable[0])
    low, high = (ratios[first - 1] if first else 0.0), ratios[first]
    while high - low > 1e-3:
        middle = (low + high) / 2
        low, high = (low, middle) if damping_at(middle) < 0 else (middle, high)
    return float(high)
