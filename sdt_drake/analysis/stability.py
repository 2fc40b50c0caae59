"""How stiff a structure has to be: a scenario's loops against an elastic joint.

The paper chooses omega_n = 0.5 omega_r, citing a rule of thumb. Here the rule is tried: each joint
of the device becomes two masses, rotor and link, with a spring that gives the locked-rotor
frequency omega_r, under the controller of the scenario, its gains scaled to omega_n = ratio *
omega_r.

Each axis stands alone, with its largest inertia. On the coupled plant a smaller inertia, or what
the other joints do, can bring the border down where speed is measured on the link: `simulate` with
`plant.elasticity` shows it. A controller of all joints at once cannot stand alone: that is swept on
the coupled plant, one joint elastic at a time, where its inertia is largest.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.analysis.linear import close, linear_feedback, linear_process
from sdt_drake.io.arrays import Array
from sdt_drake.io.progress import with_progress
from sdt_drake.robot.device import Drive, Elasticity
from sdt_drake.robot.dynamics import where_largest
from sdt_drake.run.design import Design
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.systems.gains import SpeedGains, natural_frequency
from sdt_drake.systems.state_space import StateSpace

SLOWEST = 0.1
"""Least omega_r of a sweep [rad/s]: slower than that is round-off of a sampled loop."""

IDEAL = Drive()

RATIOS = np.round(np.arange(0.1, 1.5001, 0.05), 10)
"""omega_n / omega_r."""


@dataclass(frozen=True, eq=False)
class StabilitySweep:
    """Loops of n joints with elastic joints, over omega_n / omega_r; arrays (len(ratio), n).

    Attributes:
        ratio: omega_n / omega_r [-], shape (len(ratio),).
        damping: smallest damping ratio of any mode of the loop; below 0 it is unstable [-].
        overshoot_percent: of the link's speed after a step of its reference [%], where q_ref is
            the integral of that and vd_ref is 0; NaN if unstable. Of a sampled loop it is that of
            the samples.
        border: smallest ratio at which the loop is unstable, to 1e-3, shape (n,); inf if it is
            stable at every ratio.
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
    drive: Drive = IDEAL,
    ratios: ArrayLike = RATIOS,
    damping_ratio: float = 0.01,
) -> StabilitySweep:
    """Sweep omega_n / omega_r of the scenario's controller on every joint of a robot.

    Args:
        design: gives the robot, its inertia, and the controller: its kind and structure, the
            damping ratios of its gains, and K_V, in proportion to omega_n unless it was chosen.
        omega_r: locked-rotor frequency of each elastic joint, at least SLOWEST [rad/s].
        encoder: where the controller measures, "motor" or "link".
        drive: of the motors; ideal by default. Its delay of the reference does not matter here.
        ratios: omega_n / omega_r [-], growing.
        damping_ratio: of the elastic joints [-].

    Raises:
        InputError: for a robot without rotor inertia, or what does not fit the scenario.
    """
    ratios = np.atleast_1d(np.asarray(ratios, dtype=float))
    n = design.robot.n
    rigid = _slow_design(design, drive)
    # Alone, an axis has its largest gains.
    alone, d_kk = stands_alone(design), design.torques.d_kk
    samples = rigid.inertia_share.argmax(axis=0) if alone else where_largest(d_kk)

    @cache
    def feedback(omega_n: float, sample: int) -> StateSpace:
        return linear_feedback(_tuned(rigid, omega_n), sample)

    shape = len(ratios), n
    damping, overshoot, border = np.empty(shape), np.full(shape, np.nan), np.empty(n)

    def sweep_joint(k: int, sample: int) -> None:
        frequencies = [omega_r if j == k else 0.0 for j in range(n)]
        process = _elastic_process(rigid, Elasticity(frequencies, damping_ratio, encoder), sample)

        def loop(ratio: float) -> StateSpace:
            return close(rigid, process, feedback(ratio * omega_r, sample)).closed(k)

        def damping_at(ratio: float) -> float:
            return least_damping(loop(ratio), ratio * omega_r)

        for i, ratio in enumerate(ratios.tolist()):
            closed = loop(ratio)
            damping[i, k] = least_damping(closed, ratio * omega_r)
            if damping[i, k] > 0:
                _, speed = closed.step(_SHOWN / (ratio * omega_r), _STEPS)
                overshoot[i, k] = 100 * max(speed.max() - 1, 0.0)
        border[k] = _border(damping_at, ratios, damping[:, k])

    for k, sample in enumerate(with_progress(samples.tolist())):
        sweep_joint(k, sample)
    return StabilitySweep(ratios, damping, overshoot, border)


_SHOWN, _STEPS = 20.0, 1000  # of a step response: 1 / omega_n, and samples of a continuous loop


def stands_alone(design: Design) -> bool:
    """Whether the controller can be swept on each axis alone."""
    return "axis" in CONTROLLERS[design.scenario.controller.kind].plants


def own_ratio(design: Design, omega_r: float) -> Array:
    """omega_n / omega_r of the scenario's own gains at the inertia of the sweep [-], shape (n,)."""
    return natural_frequency(design.gains, design.i_eff) / omega_r


def least_damping(loop: StateSpace, omega_n: float) -> float:
    """Smallest damping ratio -Re(s) / |s| of all modes of a loop with that omega_n [-].

    A free position neither decays nor grows; what is 1e4 times slower than the loop is one, with
    its round-off.
    """
    modes = loop.modes()
    moving = modes[np.abs(modes) > 1e-4 * omega_n]
    return float(np.min(-moving.real / np.abs(moving), initial=1.0))  # 1, where nothing moves


def _slow_design(design: Design, drive: Drive) -> Design:
    """The scenario's loops at omega_n = 1 rad/s, on the plant of the sweep, with rigid joints."""
    scenario = copy.deepcopy(design.scenario)
    scenario.plant.elasticity = Elasticity()
    if stands_alone(design):
        scenario.plant.kind = "axis"
        scenario.plant.i_eff = design.i_eff.tolist()
    scenario.drive = drive
    slow = _scaled(design.gains, 1 / own_ratio(design, 1.0))
    choice = scenario.controller
    choice.kp, choice.ki = slow.kp.tolist(), slow.ki.tolist()
    choice.omega_r = choice.zeta = None
    choice.omega_ratio = 0.5  # its default: with kp and ki no other is allowed
    return design.variant(scenario)


def _tuned(slow: Design, omega_n: float) -> Design:
    gains = _scaled(slow.gains, omega_n)
    choice = replace(slow.scenario.controller, kp=gains.kp.tolist(), ki=gains.ki.tolist())
    return replace(slow, scenario=replace(slow.scenario, controller=choice))


def _elastic_process(rigid: Design, elasticity: Elasticity, sample: int) -> StateSpace:
    plant = replace(rigid.scenario.plant, elasticity=elasticity)
    return linear_process(rigid.variant(replace(rigid.scenario, plant=plant)), sample)


def _scaled(gains: SpeedGains, factor: ArrayLike) -> SpeedGains:
    """Gains of the same damping ratios, omega_n times `factor`."""
    factor = np.asarray(factor)
    return SpeedGains(kp=factor * gains.kp, ki=factor**2 * gains.ki)


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
