"""Stability sweep: the required stiffness of the structure for the loops of a scenario.

The paper chooses omega_n = 0.5 omega_r by a rule of thumb. The sweep tests this rule. Each joint
becomes two masses, rotor and link, with a spring of the locked-rotor frequency omega_r. The
scenario's controller acts on them, with gains scaled to omega_n = ratio * omega_r.

Each axis is swept alone, with its largest inertia. With encoders on the links, the coupled plant
can become unstable at a smaller ratio, by a smaller inertia or the motion of other joints.
`simulate` with `plant.elasticity` shows this. A controller of the whole state is swept on the
coupled plant, one joint elastic at a time, where its inertia is largest.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.analysis.linear import close, linear_feedback, linear_process, operating_point
from sdt_drake.io.arguments import finite_number
from sdt_drake.io.arrays import Array, Complex
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.io.results import Results
from sdt_drake.io.shown import Figure, Shown, Summary, higher, of_joints
from sdt_drake.motion import Motion
from sdt_drake.robot.device import ENCODERS, Drive, Elasticity, Encoder
from sdt_drake.robot.dynamics import where_largest
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.options import in_print
from sdt_drake.run.scenario import Scenario
from sdt_drake.systems.gains import SpeedGains, natural_frequency
from sdt_drake.systems.state_space import StateSpace

MIN_OMEGA_R = 0.1
"""Smallest omega_r of a sweep [rad/s]; slower modes are lost in round-off of a sampled loop."""

IDEAL = Drive()
"""A drive without lag, sample period, torque error or encoder increments."""

RATIOS = np.round(np.arange(0.1, 1.5001, 0.05), 10)
"""Default ratios omega_n / omega_r of a sweep [-]."""

_STEP_TIME = 20.0
"""Duration of the step responses [1 / omega_n]."""

_STEP_SAMPLES = 1000
"""Samples of the step response of a continuous loop."""


@dataclass(frozen=True, eq=False)
class StabilitySweep:
    """Damping and overshoot of n elastic joints over omega_n / omega_r; arrays (len(ratio), n)."""

    ratio: Array
    """Ratios omega_n / omega_r [-], shape (len(ratio),)."""
    damping: Array
    """Smallest damping ratio of the loop's modes [-]; below 0 the loop is unstable."""
    overshoot_percent: Array
    """Overshoot of the link's speed after a step of v_ref, q_ref its integral and vd_ref 0 [%].
    Sampled loops have that of their samples, unstable loops NaN."""
    unstable_from: Array
    """Smallest unstable ratio, to 1e-3 [-], shape (n,); inf if there is none."""


def stability_sweep(
    design: Design,
    omega_r: float,
    *,
    encoder: Encoder = "motor",
    drive: Drive = IDEAL,
    ratios: ArrayLike = RATIOS,
    damping_ratio: float = 0.01,
    at_rest: bool = False,
) -> StabilitySweep:
    """Sweep omega_n / omega_r of the scenario's controller on every joint of a robot.

        >>> import sdt_drake as sdt
        >>> design = sdt.design(sdt.load("package://sdt/scenarios/axis_pi.yaml"))
        >>> sweep = stability_sweep(design, omega_r=65.991, encoder="link", ratios=[0.2, 0.4])
        >>> print(f"joint 1 is unstable from omega_n = {sweep.unstable_from[0]:.2f} omega_r")
        joint 1 is unstable from omega_n = 0.35 omega_r

    Args:
        design: design with the robot and the controller. The kind and structure of the controller
            and the damping ratios of its gains stay. K_V is proportional to omega_n unless the
            scenario sets it.
        omega_r: locked-rotor frequency of each elastic joint, at least MIN_OMEGA_R [rad/s].
        encoder: place of the encoder, "motor" or "link".
        drive: drive of the motors, ideal by default; its delay of the reference has no effect.
        ratios: ratios omega_n / omega_r, growing [-].
        damping_ratio: damping ratio of the elastic joints [-].
        at_rest: whether the coupled plant is linearised without the speeds of the motion.

    Raises:
        InputError: the robot has no rotor inertia, or an argument does not fit the scenario.
    """
    ratios = np.atleast_1d(np.asarray(ratios, dtype=float))
    n = design.device.simulated.n
    rigid = _slow_design(design, drive)
    # Scheduled gains of a single axis are largest at its largest inertia.
    alone, d_kk = stands_alone(design), design.torques.d_kk
    samples = rigid.tuning.inertia_share.argmax(axis=0) if alone else where_largest(d_kk)

    def point(sample: int) -> Motion:
        return operating_point(rigid, sample, at_rest=at_rest)

    @cache
    def feedback(omega_n: float, sample: int) -> StateSpace:
        gains = _scaled(rigid.tuning.gains, omega_n)
        tuned = rigid.scenario.changed({"controller.kp": gains.kp, "controller.ki": gains.ki})
        return linear_feedback(replace(rigid, scenario=tuned), sample, point(sample))

    shape = len(ratios), n
    damping, overshoot, unstable_from = np.empty(shape), np.full(shape, np.nan), np.empty(n)

    def sweep_joint(k: int, sample: int) -> None:
        frequencies = [omega_r if j == k else 0.0 for j in range(n)]
        elasticity = Elasticity(frequencies, damping_ratio, encoder)
        elastic = rigid.variant(rigid.scenario.changed({"plant.elasticity": elasticity}))
        process = linear_process(elastic, point(sample))

        def loop(ratio: float) -> StateSpace:
            return close(rigid, process, feedback(ratio * omega_r, sample)).closed(k)

        def damping_at(ratio: float) -> float:
            return least_damping(loop(ratio).modes(), ratio * omega_r)

        for i, ratio in enumerate(ratios.tolist()):
            closed = loop(ratio)
            damping[i, k] = least_damping(closed.modes(), ratio * omega_r)
            if damping[i, k] > 0:
                speed = closed.step(_STEP_TIME / (ratio * omega_r), _STEP_SAMPLES)
                overshoot[i, k] = 100 * max(speed.max() - 1, 0.0)
        unstable_from[k] = _unstable_from(damping_at, ratios, damping[:, k])

    for k, sample in enumerate(with_progress(samples.tolist())):
        sweep_joint(k, sample)
    return StabilitySweep(ratios, damping, overshoot, unstable_from)


@dataclass(frozen=True, eq=False, repr=False)
class Stability(Shown):
    """Sweeps of a scenario's controller: encoders on motor and link, ideal and its own drive."""

    design: Design
    """The design of the controller."""
    omega_r: float
    """Locked-rotor frequency of each elastic joint [rad/s]."""
    damping_ratio: float
    """Damping ratio of the elastic joints [-]."""
    sweeps: dict[str, dict[str, StabilitySweep]]
    """Sweeps by place of the encoder and by drive; the last drive is the scenario's."""

    @property
    def title(self) -> str:
        scenario = self.design.scenario
        label = in_print(scenario.controller.label)
        return f"{scenario.name}: {label}, elastic joints of {self.omega_r:g} rad/s"

    def verdict(self, encoder: str) -> str:
        """Return whether the scenario's own gains are stable, and the ratios that show it."""
        own, joint = own_ratio(self.design, self.omega_r), self.design.device.simulated.joint
        limit = [*self.sweeps[encoder].values()][-1].unstable_from
        beyond = np.flatnonzero(own >= limit).tolist()
        if beyond:
            descriptions = (
                f"{joint(k)} (omega_n / omega_r = {own[k]:.3f}, unstable from {limit[k]:.3f})"
                for k in beyond
            )
            return f"the scenario's own gains are unstable for {', '.join(descriptions)}"
        k = int((limit / own).argmin())
        least = f", unstable from {limit[k]:.3f} (joint {k + 1})" if np.isfinite(limit[k]) else ""
        return f"the scenario's own gains are stable at omega_n / omega_r = {own[k]:.3f}{least}"

    def summary(self) -> Summary:
        columns = {
            f"encoder on the {encoder}, {drive}": (".3f", sweep.unstable_from)
            for encoder, by_drive in self.sweeps.items()
            for drive, sweep in by_drive.items()
        }
        title = f"of {self.title}; smallest unstable omega_n / omega_r"
        return of_joints(title, columns, self.design.device.simulated.joint_names)

    def results(self) -> Results:
        """Return the sweeps as columns, with a row for each encoder, drive and ratio."""
        every = [(x, drive, s) for x, by in self.sweeps.items() for drive, s in by.items()]
        encoders, drives, sweeps = zip(*every, strict=True)
        counts = [len(sweep.ratio) for sweep in sweeps]
        columns = {"encoder": np.repeat(encoders, counts), "drive": np.repeat(drives, counts)}
        for name in ("ratio", "damping", "overshoot_percent"):
            columns[name] = np.concatenate([getattr(sweep, name) for sweep in sweeps])
        limits = np.repeat([sweep.unstable_from for sweep in sweeps], counts, axis=0)
        about = {"title": self.title, "omega_r": self.omega_r, "damping_ratio": self.damping_ratio}
        return Results(about, columns | {"unstable_from": limits})

    def plot(self) -> Figure:
        """Return a figure of the smallest damping ratios and overshoots over omega_n / omega_r."""
        names = self.design.device.simulated.joint_names
        return higher("show.figures.runs:stability")(self.title, self.sweeps, names)


def stability(
    design: Design | Scenario,
    *,
    omega_r: float | None = None,
    damping: float | None = None,
    at_rest: bool = False,
) -> Stability:
    """Find the largest stable gains with elastic joints, as `sdt-drake stability`.

        >>> import sdt_drake as sdt
        >>> print(sdt.stability(sdt.load("axis_pi"), omega_r=65.991).verdict("link").split(" (")[0])
        the scenario's own gains are unstable for joint 1 'planetary'

    Args:
        design: a scenario or its design.
        omega_r: lowest natural frequency of the structure [rad/s]; by default that of the scenario.
        damping: damping ratio of the elastic joints [-]; by default that of the scenario's
            plant.elasticity, or 0.01.
        at_rest: whether the coupled plant is linearised without the speeds of the motion.

    Raises:
        InputError: naming the wrong argument; `omega_r` is needed for a scenario with kp and ki.
    """
    design = as_design(design)
    if omega_r is None:
        omega_r = design.tuning.omega_r
    if omega_r is None:
        raise InputError(
            "missing, expected the lowest natural frequency of the structure [rad/s], since the "
            "scenario has kp and ki but no controller.omega_r",
            place="omega_r",
        )
    finite_number(omega_r, "omega_r", minimum=MIN_OMEGA_R)
    own = design.scenario.drive
    if damping is None:
        damping = design.scenario.plant.elasticity.damping_ratio
    finite_number(damping, "damping", minimum=0)
    drives = {"ideal drive": IDEAL} | ({"the scenario's drive": own} if own != IDEAL else {})
    sweeps: dict[str, dict[str, StabilitySweep]] = {encoder: {} for encoder in ENCODERS}
    for encoder, label in with_progress([*product(ENCODERS, drives)]):
        sweeps[encoder][label] = stability_sweep(
            design,
            omega_r,
            encoder=encoder,
            drive=drives[label],
            damping_ratio=damping,
            at_rest=at_rest,
        )
    return Stability(design, omega_r, damping, sweeps)


def stands_alone(design: Design) -> bool:
    """Return whether the controller can be swept on each axis alone."""
    return "axis" in design.scenario.controller.plants


def own_ratio(design: Design, omega_r: float) -> Array:
    """Return omega_n / omega_r of the scenario's own gains at the sweep's inertia [-], (n,)."""
    return natural_frequency(design.tuning.gains, design.i_eff) / omega_r


def least_damping(modes: Complex, omega_n: float) -> float:
    """Return the smallest damping ratio -Re(s) / |s| of modes [-].

    A mode of -inf, which is gone after one sample, has the ratio 1. Free positions do not count:
    they are modes more than 1e4 times slower than `omega_n` [rad/s].
    """
    moving = modes[np.abs(modes) > 1e-4 * omega_n]
    return float(np.min(-np.cos(np.angle(moving)), initial=1.0))  # 1 without any mode


def _slow_design(design: Design, drive: Drive) -> Design:
    """Return the design at omega_n = 1 rad/s, on the plant of the sweep, with rigid joints."""
    slow = _scaled(design.tuning.gains, 1 / own_ratio(design, 1.0))
    changes = {
        "plant.elasticity": Elasticity(),
        "drive": drive,
        "controller.kp": slow.kp,
        "controller.ki": slow.ki,
        "controller.omega_r": None,
        "controller.zeta": None,
        "controller.omega_ratio": 0.5,  # the default: no other is accepted with kp and ki
    }
    if stands_alone(design):
        changes |= {"plant.kind": "axis", "plant.i_eff": design.i_eff}
    return design.variant(design.scenario.changed(changes))


def _scaled(gains: SpeedGains, factor: ArrayLike) -> SpeedGains:
    """Return gains of the same damping ratios with omega_n times `factor`."""
    factor = np.asarray(factor)
    return SpeedGains(kp=factor * gains.kp, ki=factor**2 * gains.ki)


def _unstable_from(damping_at: Callable[[float], float], ratios: Array, damping: Array) -> float:
    """Return the smallest ratio of negative damping, found by bisection; inf if there is none."""
    unstable = np.flatnonzero(damping < 0)
    if len(unstable) == 0:
        return float("inf")
    first = int(unstable[0])
    low, high = (ratios[first - 1] if first else 0.0), ratios[first]
    while high - low > 1e-3:
        middle = (low + high) / 2
        low, high = (low, middle) if damping_at(middle) < 0 else (middle, high)
    return float(high)
