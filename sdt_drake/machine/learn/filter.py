"""The learning filter: the inverse of the loop's own linear model, as far as that can be trusted.

After flight j, what is learned (u) becomes

    u_(j+1) = Q (u_j - L e_j)

with e the position error, achieved less wanted, that the encoders see, L the inverse of the loop's
response G, and Q a zero-phase low-pass. So the error that repeats shrinks from flight to flight by
Q (1 - L G), and what is above the bandwidth of Q is not learned. Bristow, Tharayil, Alleyne, "A
survey of iterative learning control", IEEE Control Systems Magazine 26(3), 2006.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array, Complex
from sdt_drake.io.errors import InputError
from sdt_drake.machine.learn.loops import LoopSet, frequencies, known_loop, responses
from sdt_drake.run.design import Design

_LEFT = 0.5  # of an error, at most, after a flight of a loop that is trusted; and of |G|, at least
_SLOW = {"start": _LEFT, "mean": 0.02}
"""Of the largest |G| of a torque, by the speeds that are held: where it is less, slow torques are
the loop's own. A reference whose speeds are late by half a period stays late with any torque: what
was fed forward against it would be taken back by the integral, up to the motor's limit."""
_ORDER = 4  # of Q: a second-order Butterworth filter, forwards and backwards
_MARGIN = 2.0  # s, at both ends: the kernels of L and Q have died away by then


class Bandwidth(NamedTuple):
    """Up to where a joint's error is learned: [rad/s], and why not further."""

    omega: float
    why: str


@dataclass(frozen=True, eq=False)
class LearningFilter:
    """The learning filter L and the robustness filter Q of each joint.

    Attributes:
        omega: [rad/s], shape (m,).
        inverse: L over `omega`, [rad/rad] or [N m/rad], shape (m, n).
        answer: of positions to their reference, by the model [rad/rad], shape (m, n).
        bandwidth: of Q, for each joint.
        lowest: below which Q lets nothing through [rad/s], shape (n,); 0 for everything.
        period: of the samples [s].
        of: what is learned, one of `LEARNED`.
    """

    omega: Array
    inverse: Complex
    answer: Complex
    bandwidth: tuple[Bandwidth, ...]
    lowest: Array
    period: float
    of: str

    def robustness(self, omega: Array) -> Array:
        """Q [-], shape (len(omega), n)."""
        cut = np.array([bandwidth.omega for bandwidth in self.bandwidth])
        with np.errstate(divide="ignore", invalid="ignore"):
            below = np.where(self.lowest > 0, (self.lowest / omega[:, None]) ** _ORDER, 0.0)
        return np.asarray(1 / ((1 + (omega[:, None] / cut) ** _ORDER) * (1 + below)))

    def contraction(self, response: Complex) -> Complex:
        """Q (1 - L G) of a loop with the response G over `omega`, shape (m, n, n)."""
        robust, n = self.robustness(self.omega), len(self.bandwidth)
        return np.asarray(robust[:, :, None] * (np.eye(n) - self.inverse[:, :, None] * response))

    def next(self, learned: Array, error: Array) -> Array:
        """What the next flight gets from what this one had and its error, shape (N + 1, n).

        Both ends are those of a motion at rest: before it, nothing was learned and nothing is off;
        after it, both stay what they are at its end. At the start it sets in within a period of
        the bandwidth, as a flight starts on the planned motion.

        Args:
            learned: what this one had, [rad] or [N m].
            error: achieved less wanted positions, as the encoders see them [rad].
        """
        robust = self._filtered(learned, np.ones_like(self.inverse))
        return (robust - self._filtered(error, self.inverse)) * self.onset(len(error))

    def onset(self, count: int) -> Array:
        """A weight from 0 at the first sample to 1 within a period of each joint's bandwidth,
        (count, n)."""
        cut = np.array([bandwidth.omega for bandwidth in self.bandwidth])
        share = np.arange(count)[:, None] * self.period * cut / (2 * np.pi)
        return np.asarray((1 - np.cos(np.pi * np.clip(share, 0, 1))) / 2)

    def _filtered(self, values: Array, gain: Complex) -> Array:
        """Q and a gain over `omega`."""
        return through(values, gain * self.robustness(self.omega), self.omega, self.period)


def through(values: Array, gain: Complex, omega: Array, period: float) -> Array:
    """Samples of a motion, before and after which they stay what they are, through a gain.

    Args:
        values: shape (N + 1, n).
        gain: of each column over `omega`, shape (m, n); at rest what it is at the lowest omega.
        omega: growing [rad/s], shape (m,).
        period: of the samples [s].
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
    """The filter for a loop, from what its engineer knows of it.

    L inverts the mean response of each joint over the poses of the first set, the model. Q lets
    through what is below all of

    - the structure's lowest natural frequency (`controller.omega_r`): a rigid model ends there;
    - where the loop answers its reference by less than a half: the inverse asks for too much then;
    - where any of the loops would leave more than half of an error, |1 - L G| > 1/2;
    - half the Nyquist frequency.

    Args:
        design: of the loop.
        loops: of `loops_of`, for what is learned.
        of: what is learned, one of `LEARNED`.
        bandwidth: of Q for all joints instead [rad/s].

    Raises:
        InputError: for a bandwidth beyond the samples.
    """
    period, omega = design.motion.period, frequencies(design)
    mean = answer = _mean(loops[0].responses)
    if of != "reference":
        answer = _mean(responses(known_loop(design), "reference"))
    if bandwidth is not None and not 0 < bandwidth < np.pi / period:
        raise InputError(
            f"--bandwidth: {bandwidth / (2 * np.pi):g} Hz, expected > 0 and less than half the "
            f"rate of the samples, {0.5 / period:g} Hz"
        )
    if bandwidth is not None:
        chosen = [Bandwidth(bandwidth, "as given")] * design.robot.n
    else:
        every = (response for group in loops for response in group.responses)
        spread = np.max([np.abs(1 - _own(response) / mean) for response in every], axis=0)
        chosen = [
            _trusted(design, omega, np.abs(answer[:, k]), spread[:, k])
            for k in range(design.robot.n)
        ]
    size = np.abs(mean)
    lowest = np.zeros(design.robot.n)
    if of == "torque":
        slow = _SLOW[design.scenario.held_speed]
        lowest = omega[(size > slow * size.max(axis=0)).argmax(axis=0)]
    return LearningFilter(omega, 1 / mean, answer, tuple(chosen), lowest, period, of)


def _trusted(design: Design, omega: Array, answer: Array, spread: Array) -> Bandwidth:
    """Up to where a joint's model is trusted."""
    limits = [
        Bandwidth(np.pi / design.motion.period / 2, "the period of the samples"),
        Bandwidth(_first(omega, answer < _LEFT), "the loop's own bandwidth"),
        Bandwidth(_first(omega, spread > _LEFT), "the spread of the loops"),
    ]
    if design.omega_r is not None:
        limits.append(Bandwidth(design.omega_r, "the structure's natural frequency"))
    return min(limits, key=lambda limit: limit.omega)


def _mean(every: Sequence[Complex]) -> Complex:
    """Of each joint to itself, over the poses, shape (m, n)."""
    return np.asarray(np.mean([_own(response) for response in every], axis=0))


def _own(response: Complex) -> Complex:
    """Of each joint to itself, shape (m, n)."""
    return np.asarray(np.einsum("mkk->mk", response))


def _first(omega: Array, where: NDArray[np.bool_]) -> float:
    return float(omega[where.argmax()]) if where.any() else float("inf")


# --- whether it converges ------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Convergence:
    """The share of an error that is left by a flight, |Q (1 - L G)|, of the worst loop of a set.

    Attributes:
        loops: the set.
        share: of each joint alone, over the filter's frequencies [-], shape (m, n).
        together: of all joints with what they do to each other: the spectral radius [-], (m,).
    """

    loops: LoopSet
    share: Array
    together: Array

    @property
    def largest(self) -> float:
        """Below 1, every error shrinks [-]."""
        return float(max(self.share.max(), self.together.max()))


def convergence(filter_: LearningFilter, loops: LoopSet) -> Convergence:
    """How fast a filter converges on loops that are linear, and that all flights share."""
    share = np.zeros((len(filter_.omega), len(filter_.bandwidth)))
    together = np.zeros(len(filter_.omega))
    for response in loops.responses:
        left = filter_.contraction(response)
        share = np.maximum(share, np.abs(_own(left)))
        together = np.maximum(together, np.abs(np.linalg.eigvals(left)).max(axis=1))
    return Convergence(loops, share, together)


def refuse_divergence(checks: Sequence[Convergence], filter_: LearningFilter) -> None:
    """Raise InputError if an error could grow: naming the loops, the joint and the frequency; or if
    motors of the one device that is going to fly would saturate, whatever is learned."""
    for check in checks:
        name = check.loops.name
        if check.largest >= 1:
            i = int(np.maximum(check.share.max(axis=1), check.together).argmax())
            k = int(check.share[i].argmax())
            who = f"joint {k + 1}" if check.share[i, k] >= 1 else "the joints together"
            raise InputError(
                f"learning does not converge for {name}: {who} would keep {check.largest:.3g} of "
                f"an error at {filter_.omega[i] / (2 * np.pi):.3g} Hz, expected less than 1: a "
                "lower --bandwidth, or a better model"
            )
        k = int(check.loops.demand.max(axis=0).argmax())
        demand = check.loops.demand[:, k].max()
        if check.loops.devices == 1 and demand > 1:
            raise InputError(
                f"learning does not converge for {name}: the motion takes {100 * demand:.1f} % of "
                f"the torque of motor {k + 1}, which saturates whatever is learned; expected a "
                "slower motion, or a lower torque_margin"
            )
