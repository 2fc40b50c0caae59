"""Frequency responses of the closed loops, and what they are judged by."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.linear import linearise
from sdt_drake.analysis.stability import least_damping
from sdt_drake.io.arrays import Array, Complex
from sdt_drake.io.results import Results
from sdt_drake.io.shown import Shown, Summary, by_joint, face, joint_count
from sdt_drake.robot.dynamics import where_largest
from sdt_drake.run.design import Design

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_AS_AT_REST = 0.1  # rad, and powers of omega; what a loop gain may still turn and change there


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyResponse(Shown):
    """Frequency responses of each joint's loop; arrays of shape (len(omega), n) or (n,).

    Attributes:
        omega: [rad/s], shape (len(omega),).
        tracking: v / v_ref of the link, all loops closed, without feedforward [-].
        loop_gain: of the loop, cut at the motor's torque, the others closed [-]. Where
            the position is sampled around a faster speed loop, it is cut at those samples, with
            z = exp(j omega T) of their period T: the margins are those of the position loop.
        bandwidth: where |tracking| has fallen by 3 dB for good [rad/s]; NaN if beyond the range.
        peak_db: largest |tracking| [dB].
        peak_omega: where [rad/s].
        crossover: where |loop_gain| falls below 1 for the last time [rad/s]; NaN if nowhere.
        phase_margin: smallest angle of the loop gain to -180 deg where its size is 1 [deg].
        gain_margin: how much of that joint's gain, the others' as they are, brings a mode to the
            border of stability: the smallest factor above 1 [-]; inf if there is none in the range.
        gain_reduction: the same, the largest factor below 1 [-]; 0 if there is none.
        modulus_margin: smallest distance of the loop gain to -1 [-].
        damping: smallest damping ratio of the modes between v_ref and v, all loops closed [-].
        stable: whether every mode between v_ref and v decays (those at rest apart: positions).
        sample: of the motion, around which each joint's loop is linear.
        at_positions: whether loops are cut at the samples of the position.
    """

    omega: Array
    tracking: Complex
    loop_gain: Complex
    bandwidth: Array
    peak_db: Array
    peak_omega: Array
    crossover: Array
    phase_margin: Array
    gain_margin: Array
    gain_reduction: Array
    modulus_margin: Array
    damping: Array
    stable: NDArray[np.bool_]
    sample: NDArray[np.intp]
    at_positions: bool = False

    def summary(self) -> Summary:
        n = len(self.bandwidth)
        title = f"of {joint_count(n)}: speed over its reference; loop, cut at the motor"
        return Summary(title, *by_joint([""] * n, self.columns()))

    def plot(self, design: Design | None = None) -> Figure:
        """A figure of magnitude and phase; with a design, names of the joints."""
        names = [""] * len(self.bandwidth) if design is None else design.robot.joint_names
        title = "Frequency response" if design is None else design.scenario.summary().title
        return face().plots.bode(title, self, names)

    def results(self, title: str) -> Results:
        """The numbers to write: omega, and of each joint magnitude and phase of both responses."""
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
        """Where loops are cut, in words."""
        return "the position" if self.at_positions else "the motor"

    @property
    def gain_margins_db(self) -> Array:
        """Gain margin and gain reduction [dB], shape (2, n); NaN where there is none."""
        with np.errstate(divide="ignore"):
            margins = 20 * np.log10([self.gain_margin, self.gain_reduction])
        return np.where(np.isinf(margins), np.nan, margins)

    def columns(self) -> list[tuple[str, str, NDArray[Any]]]:
        """What it says of each joint, for tables: header, format, values; NaN where there is
        none."""
        rise, fall = self.gain_margins_db
        return [
            ("bandwidth [rad/s]", ".2f", self.bandwidth),
            ("peak [dB]", ".2f", self.peak_db),
            ("at [rad/s]", ".2f", self.peak_omega),
            ("crossover [rad/s]", ".2f", self.crossover),
            ("phase margin [deg]", ".1f", self.phase_margin),
            ("gain margin [dB]", ".1f", rise),
            ("downwards [dB]", ".1f", fall),
            ("modulus margin", ".3f", self.modulus_margin),
            ("damping ratio", ".3f", self.damping),
            ("stable", "", np.where(self.stable, "yes", "no")),
        ]


def frequency_response(
    design: Design, *, sample: int | None = None, points: int = 4000
) -> FrequencyResponse:
    """Frequency responses around a sample of the motion, at rest.

    Args:
        design: a resolved scenario. The drive's lag, elastic joints and all sampling in the loop
            count; limits, and friction but for its viscous part, have no frequency response.
        sample: of the motion; by default for each joint the first where its inertia is largest.
        points: of omega, from 1/1000 to 100 times the natural frequency of the speed loops (further
            with elastic joints); of a sampled loop, to the Nyquist frequency of its slowest part.
    """
    n = design.robot.n
    largest = where_largest(design.torques.d_kk).tolist()
    samples = largest if sample is None else [sample] * n
    loops = {i: linearise(design, i) for i in set(samples)}
    top = 100 * design.omega_n.max()
    if design.springs is not None:  # far above, the gains have nothing but the rotors to turn
        rotors = np.where(design.springs.elastic, design.robot.rotor_inertia, np.inf)
        top = max(top, 10 * np.max(design.gains.kp / rotors))
    period = loops[samples[0]].opened.period
    if period:
        top = np.pi / period
    omega = np.geomspace(1e-3 * design.omega_n.min(), top, points)
    tracking, gain = np.empty((2, points, n), dtype=complex)
    stable, damping = np.empty(n, dtype=bool), np.empty(n)
    for i, loop in loops.items():
        mine = [k for k in range(n) if samples[k] == i]
        tracking[:, mine] = loop.tracking(omega)[:, mine]
        gain[:, mine] = loop.loop_gain(omega)[:, mine]
        for k in mine:
            closed = loop.closed(k)
            stable[k] = is_stable(closed.modes(), design.omega_n[k])
            damping[k] = least_damping(closed, design.omega_n[k])
    size = np.abs(tracking)
    factors = [_border_gains(omega, gain[:, k]) for k in range(n)]
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
        at_positions=loops[samples[0]].at_positions,
    )


def left_out(design: Design, response: FrequencyResponse) -> list[str]:
    """What the numbers of a design's loops do not tell, a clause each, for people."""
    friction = design.scenario.plant.friction
    clauses = {
        "the margins are those of the position loops; controller.kind pi has those of the speed "
        "loops": response.at_positions,
        "of friction, only the viscous part has a frequency response": not friction.is_none,
        "the margins of an unstable loop say nothing": not response.stable.all(),
    }
    return [clause for clause, holds in clauses.items() if holds]


def is_stable(modes: Complex, omega_n: float) -> bool:
    """Whether all modes [1/s] decay; those that rest (positions) do not count."""
    return bool(np.all(modes.real < 1e-6 * omega_n))


def _last_fall(omega: Array, size: Array, level: float) -> float:
    """Where `size` falls below `level` for the last time, between points straight in the
    logarithms; NaN if it does not end below."""
    above = np.flatnonzero(size >= level)
    if len(above) == 0 or above[-1] == len(size) - 1:
        return float("nan")
    i = int(above[-1])
    share = np.log(level / size[i]) / np.log(size[i + 1] / size[i])
    return float(omega[i] * (omega[i + 1] / omega[i]) ** share)


def _phase_margin(gain: Complex) -> float:
    """Between points angle and logarithm of the size are straight; NaN without a crossover."""
    size = np.log(np.abs(gain))
    i = np.flatnonzero((size[:-1] >= 0) != (size[1:] >= 0))
    share = size[i] / (size[i] - size[i + 1])
    crossing = gain[i] * np.exp(1j * share * np.angle(gain[i + 1] / gain[i]))
    return float(min(np.degrees(np.abs(np.angle(-crossing))), default=np.nan))


def _border_gains(omega: Array, gain: Complex) -> Array:
    """Factors that bring the loop gain to -1: one over its size where it is real and negative.

    Between points angle and logarithm of the size are straight; the Nyquist frequency of a sampled
    loop, where its gain is real, is the last point. The first stands for a standstill, if the gain
    is as good as constant there: against gravity that overturns a link, where less gain holds it no
    longer.
    """
    angle, size = np.angle(-gain), np.log(np.abs(gain))
    i = np.flatnonzero((angle[:-1] * angle[1:] <= 0) & (np.abs(np.diff(angle)) < np.pi))
    share = angle[i] / (angle[i] - angle[i + 1] + 1e-300)
    crossed = size[i] + share * (size[i + 1] - size[i])
    slope = (size[1] - size[0]) / np.log(omega[1] / omega[0])
    is_border = [np.hypot(angle[0], slope) < _AS_AT_REST, abs(angle[-1]) < 1e-6]
    return np.exp(-np.append(crossed, size[[0, -1]][is_border]))


def unwrapped_degrees(response: Complex, *, at_crossover: bool = False) -> Array:
    """Phase of complex numbers along their first axis, without jumps [deg].

    It starts between -180 and 180 deg; or it has between -270 and 90 deg where the size falls
    below 1 for the last time, for loop gains, whose phase at low frequency says little.
    """
    phase = np.degrees(np.unwrap(np.angle(response), axis=0))
    if not at_crossover:
        return phase
    n = response.shape[1]
    above = [np.flatnonzero(np.abs(response[:, k]) >= 1) for k in range(n)]
    at = np.array([phase[i[-1] if len(i) else -1, k] for k, i in enumerate(above)])
    return phase - 360 * np.ceil((at - 90) / 360)
