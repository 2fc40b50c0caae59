"""Frequency responses of the loops, and their margins and bandwidths."""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.linear import LinearLoop, linearise
from sdt_drake.analysis.stability import least_damping
from sdt_drake.io.arguments import finite_number
from sdt_drake.io.arrays import Array, Complex
from sdt_drake.io.errors import InputError
from sdt_drake.io.results import Results
from sdt_drake.io.shown import Figure, Shown, Summary, by_joint, formatted, higher, joint_count
from sdt_drake.robot.dynamics import where_largest
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.scenario import Scenario

_MAX_STATIC_CHANGE = 0.1
"""Largest phase [rad] and slope [powers of omega] of a loop gain that counts as constant."""


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyResponse(Shown):
    """Frequency responses of each joint's loop; arrays of shape (len(omega), n) or (n,)."""

    omega: Array
    """Frequencies [rad/s], shape (len(omega),)."""
    tracking: Complex
    """Response v / v_ref of the link, all loops closed, without feedforward [-]."""
    loop_gain: Complex
    """Gain of the loop that is cut at the motor torque, all other loops closed [-]. A position loop
    around a faster speed loop is cut at its samples instead: z = exp(j omega T), with its sample
    period T. The margins are then those of the position loop."""
    bandwidth: Array
    """Frequency above which |tracking| stays below -3 dB [rad/s]; NaN if beyond the range."""
    peak_db: Array
    """Largest |tracking| [dB]."""
    peak_omega: Array
    """Frequency of the largest |tracking| [rad/s]."""
    crossover: Array
    """Highest frequency at which |loop_gain| falls below 1 [rad/s]; NaN if there is none."""
    phase_margin: Array
    """Smallest angle between loop gain and -180 deg where |loop_gain| is 1 [deg]."""
    gain_margin: Array
    """Smallest factor above 1 on this joint's gain alone that makes the loop marginally stable [-];
    inf (unlimited) if there is none in the range."""
    gain_reduction: Array
    """Largest factor below 1 on this joint's gain alone that makes the loop marginally stable [-];
    0 if there is none."""
    modulus_margin: Array
    """Smallest distance between loop gain and -1 [-]."""
    damping: Array
    """Smallest damping ratio of the modes between v_ref and v, all loops closed [-]. Joints that
    move each other share their modes."""
    stable: NDArray[np.bool_]
    """True if every mode between v_ref and v decays; free positions do not count."""
    sample: NDArray[np.intp]
    """Sample of the motion at which each joint's loop is linearised."""
    coupled: LinearLoop
    """Loop of all joints where the least damped joint is linearised."""

    @property
    def at_positions(self) -> bool:
        """True if loops are cut at the samples of the position."""
        return self.coupled.at_positions

    @property
    def poles(self) -> Complex:
        """Poles of the coupled loop [1/s], slowest first.

        Positions that a speed loop leaves free have poles at 0, and so have references.
        """
        return _slowest_first(self.coupled.closed().modes())

    @property
    def zeros(self) -> Complex:
        """Transmission zeros of the coupled loop from all v_ref to all v [1/s], slowest first."""
        return _slowest_first(self.coupled.closed().zeros())

    @cached_property
    def singular_values(self) -> Array:
        """Singular values of the coupled loop from all v_ref to all v [-], (len(omega), n).

        The largest is the most that joints in phase give, over all directions of v_ref.
        """
        response = self.coupled.closed().response(self.omega)
        return np.asarray(np.linalg.svd(response, compute_uv=False))

    def summary(self) -> Summary:
        n = len(self.bandwidth)
        title = f"of {joint_count(n)}: speed over its reference; loop, cut at the motor"
        return Summary(title, *by_joint([""] * n, self.columns()))

    def plot(self, design: Design | None = None) -> Figure:
        """Return a figure of magnitude and phase; a design gives the joints their names."""
        title, names = "Frequency response", [""] * len(self.bandwidth)
        if design is not None:
            title, names = design.scenario.summary().title, [*design.device.simulated.joint_names]
        return higher("show.figures.runs:bode")(title, self, names)

    def plot_coupled(self, design: Design | None = None) -> Figure:
        """Return a figure of Nyquist curves, poles and zeros, and singular values."""
        title, names = "Coupled loop", [""] * len(self.bandwidth)
        if design is not None:
            title, names = design.scenario.summary().title, [*design.device.simulated.joint_names]
        return higher("show.figures.coupled_loop:coupled_loop")(title, self, names)

    def results(self, title: str) -> Results:
        """Return the numbers of a file: omega, and magnitude and phase of both responses."""
        columns = {"omega": self.omega}
        for name, values in (("tracking", self.tracking), ("loop_gain", self.loop_gain)):
            columns[f"{name}_magnitude"] = np.abs(values)
            at_crossover = name == "loop_gain"
            columns[f"{name}_phase"] = unwrapped_degrees(values, at_crossover=at_crossover)
        rows = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "omega"}
        judged = {name: values for name, values in rows.items() if np.ndim(values) == 1}
        return Results({"title": title, "loops_cut_at": self.cut, **judged}, columns)

    @property
    def cut(self) -> str:
        """Place where the loops are cut, for texts."""
        return "the position" if self.at_positions else "the motor"

    @property
    def gain_margins_db(self) -> Array:
        """Gain margin and gain reduction [dB], shape (2, n); NaN where there is none."""
        with np.errstate(divide="ignore"):
            margins = 20 * np.log10([self.gain_margin, self.gain_reduction])
        return np.where(np.isinf(margins), np.nan, margins)

    def columns(self) -> list[tuple[str, str, NDArray[Any]]]:
        """Return the columns of a table by joint: header, format, values (NaN: there is none)."""

        def in_words(margins: Array) -> NDArray[np.str_]:
            texts = [formatted(margin, ".1f") for margin in margins]
            return np.where(np.isnan(margins) & self.stable, "unlimited", texts)

        rise, fall = self.gain_margins_db
        return [
            ("bandwidth [rad/s]", ".2f", self.bandwidth),
            ("peak [dB]", ".2f", self.peak_db),
            ("at [rad/s]", ".2f", self.peak_omega),
            ("crossover [rad/s]", ".2f", self.crossover),
            ("phase margin [deg]", ".1f", self.phase_margin),
            ("gain margin [dB]", "", in_words(rise)),
            ("gain may fall by [dB]", "", in_words(-fall)),
            ("modulus margin", ".3f", self.modulus_margin),
            ("damping ratio", ".3f", self.damping),
            ("stable", "", np.where(self.stable, "yes", "no")),
        ]


def bode(
    design: Design | Scenario, *, time: float | None = None, at_rest: bool = False
) -> FrequencyResponse:
    """Compute frequency responses, margins and damping of each joint's loop, as `sdt-drake bode`.

        response = sdt.bode(sdt.load("coupled_pi"))
        print(response)  # bandwidth, margins, damping
        response.plot().savefig("bode.png")

    >>> import sdt_drake as sdt
    >>> sdt.bode(sdt.load("axis_pi"), time=0).bandwidth.round(1)  # [rad/s], shape (n,)
    array([22.8, 21.9, 21.6, 22.9])

    Args:
        design: a scenario or its design.
        time: time of the motion at which the loops are linearised [s]. By default each joint's
            loop is linearised where its inertia is largest for the first time.
        at_rest: whether to linearise at the angles of that time without the speeds.

    Raises:
        InputError: for a time after the end of the motion, or a controller that cannot be
            linearised.
    """
    design = as_design(design)
    if time is None:
        return frequency_response(design, at_rest=at_rest)
    motion = design.reference.tracked
    if finite_number(time, "time", minimum=0) > motion.duration:
        raise InputError(f"{time:g} s, the motion ends at {motion.duration:g} s", place="time")
    return frequency_response(design, sample=round(time / motion.period), at_rest=at_rest)


def frequency_response(
    design: Design, *, sample: int | None = None, points: int = 4000, at_rest: bool = False
) -> FrequencyResponse:
    """Return frequency responses and margins around a sample of the motion, at its speeds.

    The model includes drive lag, elastic joints, viscous friction and every sample period. Motor
    limits and dry friction have no frequency response and are left out.

        >>> import sdt_drake as sdt
        >>> design = sdt.design(sdt.load("package://sdt/scenarios/axis_pi.yaml"))
        >>> response = frequency_response(design, points=200)
        >>> print(*(f"{margin:.0f} deg" for margin in response.phase_margin))
        75 deg 76 deg 76 deg 75 deg

    Args:
        design: the design to analyse.
        sample: index of the sample; by default, for each joint, that of its largest inertia.
        points: number of frequencies, from 1/1000 to 100 times the natural frequency of the speed
            loops (further with elastic joints). Sampled loops end at the Nyquist frequency of their
            slowest part.
        at_rest: whether to linearise at the angles of the sample without its speeds.
    """
    n = design.device.simulated.n
    largest = where_largest(design.torques.d_kk).tolist()
    samples = largest if sample is None else [sample] * n
    loops = {i: linearise(design, i, at_rest=at_rest) for i in set(samples)}
    top = 100 * design.tuning.omega_n.max()
    if design.springs is not None:  # far above resonance, the gains act on the rotors alone
        rotors = np.where(design.springs.elastic, design.device.simulated.motor_inertia, np.inf)
        top = max(top, 10 * np.max(design.tuning.gains.kp / rotors))
    period = loops[samples[0]].opened.period
    if period:
        top = np.pi / period
    omega = np.geomspace(1e-3 * design.tuning.omega_n.min(), top, points)
    tracking, gain = np.empty((2, points, n), dtype=complex)
    stable, damping = np.empty(n, dtype=bool), np.empty(n)
    for i, loop in loops.items():
        mine = [k for k in range(n) if samples[k] == i]
        tracking[:, mine] = loop.tracking(omega)[:, mine]
        gain[:, mine] = loop.loop_gain(omega)[:, mine]
        for k in mine:
            modes = loop.closed(k).modes_between()
            # Modes at rest (free positions) do not count.
            stable[k] = np.all(modes.real < 1e-6 * design.tuning.omega_n[k])
            damping[k] = least_damping(modes, design.tuning.omega_n[k])
    size = np.abs(tracking)
    factors = [_critical_gains(omega, gain[:, k]) for k in range(n)]
    return FrequencyResponse(
        omega=omega,
        tracking=tracking,
        loop_gain=gain,
        bandwidth=np.array([_last_fall(omega, size[:, k], np.sqrt(0.5)) for k in range(n)]),
        peak_db=20 * np.log10(size.max(axis=0)),
        peak_omega=omega[size.argmax(axis=0)],
        crossover=np.array([_last_fall(omega, np.abs(gain[:, k]), 1.0) for k in range(n)]),
        phase_margin=np.array([_phase_margin(gain[:, k]) for k in range(n)]),
        gain_margin=np.array([min(f[f > 1], default=np.inf) for f in factors]),
        gain_reduction=np.array([max(f[f < 1], default=0.0) for f in factors]),
        modulus_margin=np.abs(1 + gain).min(axis=0),
        damping=damping,
        stable=stable,
        sample=np.array(samples),
        coupled=loops[samples[int(damping.argmin())]],
    )


def left_out(design: Design, response: FrequencyResponse) -> list[str]:
    """Return the restrictions on the numbers of a response, a clause each."""
    friction = design.scenario.plant.friction
    clauses = {
        "the margins are those of the position loops; controller.kind pi has those of the speed "
        "loops": response.at_positions,
        "only viscous friction has a frequency response": not friction.is_none,
        "the margins of an unstable loop have no meaning": not response.stable.all(),
    }
    return [clause for clause, holds in clauses.items() if holds]


def _slowest_first(values: Complex) -> Complex:
    return values[np.argsort(np.abs(values), kind="stable")]


def _last_fall(omega: Array, size: Array, level: float) -> float:
    """Return the highest frequency at which `size` falls below `level` [rad/s].

    Between points the logarithms are linear. NaN if the last point is not below.
    """
    above = np.flatnonzero(size >= level)
    if len(above) == 0 or above[-1] == len(size) - 1:
        return float("nan")
    i = int(above[-1])
    share = np.log(level / size[i]) / np.log(size[i + 1] / size[i])
    return float(omega[i] * (omega[i + 1] / omega[i]) ** share)


def _phase_margin(gain: Complex) -> float:
    """Return the smallest phase margin of all crossovers [deg]; NaN without a crossover.

    Between points angle and logarithm of the size are linear.
    """
    size = np.log(np.abs(gain))
    i = np.flatnonzero((size[:-1] >= 0) != (size[1:] >= 0))
    share = size[i] / (size[i] - size[i + 1])
    crossing = gain[i] * np.exp(1j * share * np.angle(gain[i + 1] / gain[i]))
    return float(min(np.degrees(np.abs(np.angle(-crossing))), default=np.nan))


def _critical_gains(omega: Array, gain: Complex) -> Array:
    """Return the factors that bring the loop gain to -1: 1 / |gain| where it is real and negative.

    Between points angle and logarithm of the size are linear. The last point of a sampled loop is
    its Nyquist frequency, where the gain is real. The first point stands for frequency 0 if the
    gain is constant there: too little gain then cannot hold a link that gravity overturns.
    """
    angle, size = np.angle(-gain), np.log(np.abs(gain))
    i = np.flatnonzero((angle[:-1] * angle[1:] <= 0) & (np.abs(np.diff(angle)) < np.pi))
    share = angle[i] / (angle[i] - angle[i + 1] + 1e-300)
    crossed = size[i] + share * (size[i + 1] - size[i])
    slope = (size[1] - size[0]) / np.log(omega[1] / omega[0])
    is_real = [np.hypot(angle[0], slope) < _MAX_STATIC_CHANGE, abs(angle[-1]) < 1e-6]
    return np.exp(-np.append(crossed, size[[0, -1]][is_real]))


def unwrapped_degrees(response: Complex, *, at_crossover: bool = False) -> Array:
    """Return the phase of complex numbers along their first axis, without jumps [deg].

    The phase starts between -180 and 180 deg. With `at_crossover`, as usual for loop gains, it lies
    between -270 and 90 deg at the highest frequency with a size of 1 or more.
    """
    phase = np.degrees(np.unwrap(np.angle(response), axis=0))
    if not at_crossover:
        return phase
    n = response.shape[1]
    above = [np.flatnonzero(np.abs(response[:, k]) >= 1) for k in range(n)]
    at = np.array([phase[i[-1] if len(i) else -1, k] for k, i in enumerate(above)])
    return phase - 360 * np.ceil((at - 90) / 360)
