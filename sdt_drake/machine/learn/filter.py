"""The learning filter: the inverse of the loop's linear model, up to a frequency of trust.

After trial j, the learned signal u becomes

    u_(j+1) = Q (u_j - L e_j)

Here e is the position error at the encoders (achieved minus planned), and L the inverse of the
loop's response G. Q is a zero-phase low-pass filter. The repeating error shrinks by Q (1 - L G) in
each trial. Above the bandwidth of Q nothing is learned. Source: Bristow, Tharayil, Alleyne, "A
survey of iterative learning control", IEEE Control Systems Magazine 26(3), 2006.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array, Complex
from sdt_drake.io.errors import InputError
from sdt_drake.machine.learn.loops import LoopSet, frequencies, known_loop, responses
from sdt_drake.run.design import Design

_MAX_REMAINDER = 0.5  # share of the error after a trial, for a loop that is trusted
_MIN_ANSWER = 0.5  # |G| of the reference, for a loop that is trusted
_MIN_TORQUE_ANSWER = {"start": 0.5, "mean": 0.02}
"""Share of the largest |G| of a torque below which slow torques are not learned, by `held_speed`.

A reference whose speeds are late by half a period stays late with any torque. The loop's integral
would cancel a torque that is learned against this error, up to the motor's limit."""

_ORDER = 4  # order of Q: a second-order Butterworth filter, forwards and backwards
_MARGIN = 2.0  # s, at both ends: the kernels of L and Q are shorter


class Bandwidth(NamedTuple):
    """The bandwidth up to which a joint's error is learned."""

    omega: float
    """Bandwidth [rad/s]."""
    why: str
    """Limit that determines the bandwidth."""


@dataclass(frozen=True, eq=False)
class LearningFilter:
    """The learning filter L and the robustness filter Q of each joint."""

    omega: Array
    """Frequencies of the responses [rad/s], shape (m,)."""
    inverse: Complex
    """L over `omega` [rad/rad] or [N m/rad], shape (m, n)."""
    answer: Complex
    """Response of positions to their reference, by the model [rad/rad], shape (m, n)."""
    bandwidth: tuple[Bandwidth, ...]
    """Bandwidth of Q of each joint."""
    lowest: Array
    """Frequency below which Q blocks [rad/s], shape (n,); 0 if it passes all low frequencies."""
    period: float
    """Sample period [s]."""
    of: str
    """Learned signal, one of `LEARNED`."""

    def robustness(self, omega: Array) -> Array:
        """Return Q [-], shape (len(omega), n)."""
        cut = np.array([bandwidth.omega for bandwidth in self.bandwidth])
        with np.errstate(divide="ignore", invalid="ignore"):
            below = np.where(self.lowest > 0, (self.lowest / omega[:, None]) ** _ORDER, 0.0)
        return np.asarray(1 / ((1 + (omega[:, None] / cut) ** _ORDER) * (1 + below)))

    def next(self, learned: Array, error: Array) -> Array:
        """Return the learned signal of the next trial, shape (N + 1, n).

        The motion starts and ends at rest: before it, signal and error are 0; after it, they keep
        their last values. The result grows from 0 within a period of the bandwidth, since every
        trial starts on the planned motion.

        Args:
            learned: learned signal of this trial [rad] or [N m], shape (N + 1, n).
            error: position error of this trial at the encoders [rad], shape (N + 1, n).
        """
        robust = self._filtered(learned, np.ones_like(self.inverse))
        return (robust - self._filtered(error, self.inverse)) * self.onset(len(error))

    def onset(self, count: int) -> Array:
        """Return weights that grow from 0 to 1 within a period of the bandwidth, (count, n)."""
        cut = np.array([bandwidth.omega for bandwidth in self.bandwidth])
        share = np.arange(count)[:, None] * self.period * cut / (2 * np.pi)
        return np.asarray((1 - np.cos(np.pi * np.clip(share, 0, 1))) / 2)

    def _filtered(self, values: Array, gain: Complex) -> Array:
        """Return values filtered by Q and by a gain over `omega`."""
        return through(values, gain * self.robustness(self.omega), self.omega, self.period)


def through(values: Array, gain: Complex, omega: Array, period: float) -> Array:
    """Return the samples of a motion filtered by a gain.

    Before and after the samples, their first and last values continue.

    Args:
        values: samples, shape (N + 1, n).
        gain: gain of each column over `omega`, shape (m, n); the first one also below omega[0].
        omega: growing frequencies [rad/s], shape (m,).
        period: sample period [s].
    """
    margin = round(_MARGIN / period)
    back = (1 + np.cos(np.pi * np.linspace(0, 1, margin)))[:, None] / 2
    first, last = values[:1], values[-1:]
    ends = [np.repeat(first, margin, axis=0), np.repeat(last, margin, axis=0)]
    around = np.vstack([ends[0], values, ends[1], first + (last - first) * back])
    spectrum = np.fft.rfft(around, axis=0)
    at, known = 2 * np.pi * np.fft.rfftfreq(len(around), period), np.append(0.0, omega)
    for k, own in enumerate(np.vstack([gain[:1].real, gain]).T):
        spectrum[:, k] *= np.interp(at, known, own)
    out = np.fft.irfft(spectrum, len(around), axis=0)
    return np.asarray(out[margin : margin + len(values)])


def design_filter(
    design: Design, loops: Sequence[LoopSet], of: str, *, bandwidth: float | None = None
) -> LearningFilter:
    """Return the learning filter for a loop, from its model.

    L inverts the mean response of each joint over the poses of the first loop set, the model. The
    bandwidth of Q is the lowest of

    - the structure's lowest natural frequency (`controller.omega_r`), the limit of a rigid model;
    - the frequency where the loop's response falls below 1/2, as its inverse becomes too large;
    - the frequency where a trial would leave over half the error of any loop, |1 - L G| > 1/2;
    - half the Nyquist frequency.

    Args:
        design: design of the loop.
        loops: loop sets of `loops_of` for the learned signal.
        of: learned signal, one of `LEARNED`.
        bandwidth: bandwidth of Q for all joints, in place of the one above [rad/s].

    Raises:
        InputError: for a bandwidth that is not between 0 and the Nyquist frequency.
    """
    period, omega = design.reference.tracked.period, frequencies(design)
    mean = answer = _mean(loops[0].responses)
    if of != "reference":
        answer = _mean(responses(known_loop(design), "reference"))
    if bandwidth is not None and not 0 < bandwidth < np.pi / period:
        raise InputError(
            f"{bandwidth / (2 * np.pi):g} Hz, expected > 0 and < {0.5 / period:g} Hz, half the "
            "sample rate",
            place="bandwidth",
        )
    if bandwidth is not None:
        chosen = [Bandwidth(bandwidth, "as given")] * design.device.simulated.n
    else:
        every = (response for group in loops for response in group.responses)
        spread = np.max([np.abs(1 - _own(response) / mean) for response in every], axis=0)
        chosen = [
            _trusted(design, omega, np.abs(answer[:, k]), spread[:, k])
            for k in range(design.device.simulated.n)
        ]
    size = np.abs(mean)
    lowest = np.zeros(design.device.simulated.n)
    if of == "torque":
        share = _MIN_TORQUE_ANSWER[design.scenario.held_speed]
        lowest = omega[(size > share * size.max(axis=0)).argmax(axis=0)]
    return LearningFilter(omega, 1 / mean, answer, tuple(chosen), lowest, period, of)


def _trusted(design: Design, omega: Array, answer: Array, spread: Array) -> Bandwidth:
    """Return the bandwidth up to which a joint's model is trusted."""
    limits = [
        Bandwidth(np.pi / design.reference.tracked.period / 2, "the sample period"),
        Bandwidth(_first(omega, answer < _MIN_ANSWER), "the loop's own bandwidth"),
        Bandwidth(_first(omega, spread > _MAX_REMAINDER), "the spread of the loops"),
    ]
    if design.tuning.omega_r is not None:
        limits.append(Bandwidth(design.tuning.omega_r, "the structure's natural frequency"))
    return min(limits, key=lambda limit: limit.omega)


def _mean(every: Sequence[Complex]) -> Complex:
    """Return the mean response of each joint to its own input over the poses, shape (m, n)."""
    return np.asarray(np.mean([_own(response) for response in every], axis=0))


def _own(response: Complex) -> Complex:
    """Return the response of each joint to its own input, shape (m, n)."""
    return np.asarray(np.einsum("mkk->mk", response))


def _first(omega: Array, where: NDArray[np.bool_]) -> float:
    """Return the first frequency where a mask is true; infinity if there is none."""
    return float(omega[where.argmax()]) if where.any() else float("inf")


# --- convergence ---------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Convergence:
    """The share of an error that remains after a trial, |Q (1 - L G)|, for a set's worst loop."""

    loops: LoopSet
    """The loop set."""
    share: Array
    """Remaining share of each joint alone, over the filter's frequencies [-], shape (m, n)."""
    together: Array
    """Remaining share of all joints with their coupling: the spectral radius [-], shape (m,)."""

    @property
    def largest(self) -> float:
        """Largest remaining share [-]; below 1, learning converges."""
        return float(max(self.share.max(), self.together.max()))


def convergence(filter_: LearningFilter, loops: LoopSet) -> Convergence:
    """Return the convergence of a filter for a set of linear, time-invariant loops."""
    n, robust = len(filter_.bandwidth), filter_.robustness(filter_.omega)[:, :, None]
    share, together = np.zeros((len(filter_.omega), n)), np.zeros(len(filter_.omega))
    for response in loops.responses:
        left = robust * (np.eye(n) - filter_.inverse[:, :, None] * response)  # Q (1 - L G)
        share = np.maximum(share, np.abs(_own(left)))
        together = np.maximum(together, np.abs(np.linalg.eigvals(left)).max(axis=1))
    return Convergence(loops, share, together)


def refuse_divergence(checks: Sequence[Convergence], filter_: LearningFilter) -> None:
    """Raise InputError if learning does not converge, with the loops, joint and frequency.

    A single device must also have enough torque for the motion: saturated motors cannot learn.
    """
    for check in checks:
        name = check.loops.name
        if check.largest >= 1:
            i = int(np.maximum(check.share.max(axis=1), check.together).argmax())
            k = int(check.share[i].argmax())
            where = f"joint {k + 1}" if check.share[i, k] >= 1 else "the joints together"
            raise InputError(
                f"learning does not converge for {name}: {where} would keep {check.largest:.3g} of "
                f"an error at {filter_.omega[i] / (2 * np.pi):.3g} Hz, expected less than 1; use "
                "a lower bandwidth=... or a better model"
            )
        k = int(check.loops.demand.max(axis=0).argmax())
        demand = check.loops.demand[:, k].max()
        if check.loops.devices == 1 and demand > 1:
            raise InputError(
                f"learning does not converge for {name}: the motion needs {100 * demand:.1f} % of "
                f"the torque of motor {k + 1}, which always saturates; plan a slower motion, or "
                "use a lower torque_margin"
            )
