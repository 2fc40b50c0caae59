"""Likely causes of the residual torque that rigid links and friction do not explain.

Causes are delayed torques, springs, hysteresis, a force that depends on the position, and changing
friction. Links and friction of each joint are free and are removed from all signals by projection.
The measure of a cause is the share of the squared residual that its columns explain. With a delay
d, links and friction explain tau(t + d). The delay is found by the Gauss-Newton method, its
interval by the jackknife over blocks of time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from sdt_drake.io.arrays import Array, Index
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.explained import basis, over_largest, share_explained, without
from sdt_drake.machine.diagnose.finding import Finding, finding, kinds
from sdt_drake.machine.identify.equations import Equations


@dataclass(frozen=True, eq=False)
class Delay:
    """The delay of recorded torques behind positions."""

    common: float
    """Common delay of all joints [s]."""
    error: float
    """Standard error of the common delay [s]."""
    each: Array
    """Delay of each joint [s], shape (n,); NaN without motion."""
    errors: Array
    """Standard error of each delay [s], shape (n,); NaN without motion."""
    gain: float
    """Share of the squared residual that the common delay explains [-]; 0 if it explains less of
    held-out data."""
    most: float
    """Longest delay that is found [s]. A delay there is no measurement."""

    @property
    def is_significant(self) -> bool:
        """True for a significant and relevant delay on which the joints agree.

        At least half of the joints have a significant delay of their own.
        """
        known = np.isfinite(self.each)
        each, errors = self.each[known], self.errors[known]
        is_large = abs(self.common) > max(c.DELAY_SIGMAS * self.error, c.MIN_DELAY)
        is_large &= abs(self.common) < c.AT_BOUND * self.most
        apart = np.abs(each - self.common)
        agree = apart < np.maximum(c.AGREE_SIGMAS * errors, c.DELAYS_AGREE * abs(self.common))
        by_itself = each * np.sign(self.common) > c.OWN_SIGMAS * errors
        is_relevant = is_large and self.gain > c.MIN_DELAY_GAIN
        return bool(is_relevant and agree.all() and by_itself.mean() >= 0.5)

    @property
    def findings(self) -> list[Finding]:
        """The finding of late torques; none for a delay that is not significant."""
        if not self.is_significant:
            return []
        delay = {"delay_s": self.common, "error_s": self.error, "interval_s": 2 * self.error}
        each = ", ".join(
            "–" if np.isnan(d) else f"{1e3 * d:.1f} ± {2e3 * e:.1f}"
            for d, e in zip(self.each, self.errors, strict=True)
        )
        remedy = f"torque_delay: {self.common:.4f}"
        return [finding("late torques", (), remedy, each=each, share=self.gain, **delay)]


def delay_of(eq: Equations, cutoff: float) -> Delay:
    """Return the delay of torques that are compared below `cutoff` [Hz]."""
    return _delay_of(joints_of(eq), cutoff)


def joints_of(eq: Equations, links: Array | None = None) -> list[Joint]:
    """Return the torque of each joint in the rows with motion, with `links` as in `left_over`."""
    return [Joint(eq, k, links) for k in range(eq.n)]


def _delay_of(joints: Sequence[Joint], cutoff: float) -> Delay:
    moving, most = [one for one in joints if one.moves], c.MAX_DELAY / cutoff
    common, error, gain = _delay(moving, most)
    each = [_delay([one], most) if one.moves else (np.nan, np.nan, 0.0) for one in joints]
    delay = Delay(
        common,
        error,
        np.array([d for d, *_ in each]),
        np.array([e for _, e, _ in each]),
        gain,
        most,
    )
    if delay.is_significant and sum(one.held_out_gain(common) for one in moving) < 0:
        return replace(delay, gain=0.0)
    return delay


def left_over(eq: Equations, cutoff: float, predicted: Array, links: Array | None) -> list[Finding]:
    """Return the delay of torques, and the residual torque of each joint with likely causes.

    Args:
        eq: The equations.
        cutoff: Cut-off frequency of the compared torques [Hz].
        predicted: Torque of the best links and friction [N m], shape (M, n).
        links: Columns of all links if some were taken from the file, shape (M, n, 11 n).
    """
    joints = joints_of(eq, links)
    delay = _delay_of(joints, cutoff)
    return [*delay.findings, *_unexplained(joints, delay, eq.tau - predicted)]


def _unexplained(joints: Sequence[Joint], delay: Delay, shared: Array) -> Iterator[Finding]:
    """Yield the residual torque of each joint and its likely causes.

    A significant common delay is corrected first. Links of one joint alone may explain a force on
    its position that the links of all joints leave in the residual `shared`.
    """
    common = delay.common if delay.is_significant else 0.0
    for k, one in enumerate(joints):
        if not one.moves:
            continue
        left, _ = one.seen(common)
        share, explains = one.explained(left, one.basis)
        rest = without(one.rubs, shared[one.rows, k])
        if common == 0 and np.linalg.norm(rest) > c.ELSE * np.linalg.norm(left):
            more, of_rest = one.explained(rest, one.rubs)
            best = max(of_rest.values())
            if more > c.SOME_LEFT and of_rest["position"] == best > c.CAUSE_EXPLAINS:
                share, explains = more, of_rest
        d, e = float(delay.each[k]), float(delay.errors[k])
        if abs(d) > c.AT_BOUND * delay.most:  # no measurement, so no delay
            explains["late"] = 0.0
        best = max(explains.values())
        is_late = explains["late"] == best > c.LATE and (
            abs(d - common) > max(c.DELAY_SIGMAS * e, c.MIN_DELAY)
        )
        text = ""
        limit = c.CAUSE_EXPLAINS if share > c.SOME_LEFT else c.CAUSE_EXPLAINS_LITTLE
        if is_late or (share > c.LITTLE_LEFT and best > limit):
            likely = [name for name in explains if explains[name] > best - c.AS_LIKELY]
            likely.sort(key=lambda name: -explains[name])
            late = f"a torque that is {1e3 * d:.1f} ± {2e3 * e:.1f} ms late"
            causes = {"late": late, **kinds()["residual"]["causes"]}
            text = f"; {100 * best:.0f} % of the squared residual looks like "
            text += "one of " * (len(likely) > 1) + "; ".join(causes[name] for name in likely)
        elif share <= c.MUCH_LEFT:
            continue
        yield finding("residual", (k + 1,), likely=text, share=share, **explains)


class Joint:
    """The torque of a joint over the stretches of a recording, without links and friction."""

    def __init__(self, eq: Equations, k: int, links: Array | None):
        self.eq, self.k, self.links = eq, k, links
        counts = eq.moves[:, k]
        self.moves = bool(counts.mean() > c.MOVES_SHARE and counts.sum() > c.MIN_MOVING_ROWS)
        if not self.moves:
            return
        self.rows = np.flatnonzero(counts)
        self.basis = basis(np.column_stack([eq.rigid[:, k], eq.friction[:, k]])[self.rows])
        self.rubs = basis(eq.friction[self.rows, k])
        tau = eq.tau[self.rows, k]
        self.spread = float(np.sum((tau - tau.mean()) ** 2))
        self.splines: list[tuple[Index, BSpline]] = []
        for part in np.unique(eq.part):
            at = np.flatnonzero(eq.part == part)
            if len(at) > 5:
                self.splines.append((at, make_interp_spline(eq.time[at], eq.tau[at, k], k=5)))

    def explained(self, left: Array, known: Array) -> tuple[float, dict[str, float]]:
        """Return a residual over the torque [-], and the share of its square by each cause.

        Args:
            left: The residual [N m].
            known: Orthonormal columns that were removed from it.
        """
        size = float(np.sqrt(left @ left / max(self.spread, 1e-300)))
        causes = self.causes().items()
        return size, {name: share_explained(left, without(known, C)) for name, C in causes}

    def torque(self, shift: float, order: int = 0) -> Array:
        """Return the torque, or a derivative, later by `shift` [s], in the rows with motion."""
        whole = np.zeros(len(self.eq.tau))
        for at, spline in self.splines:
            time = np.clip(self.eq.time[at] + shift, self.eq.time[at[0]], self.eq.time[at[-1]])
            whole[at] = spline(time, order)
        return whole[self.rows]

    def seen(self, shift: float) -> tuple[Array, Array]:
        """Return the residual of the torque later by `shift` [s], and that of its slope."""
        tau, slope = self.torque(shift), self.torque(shift, 1)
        return without(self.basis, tau), without(self.basis, slope)

    def held_out_gain(self, shift: float) -> float:
        """Return how much more of held-out torque is explained if it is later by `shift` [s] [-].

        It is the logarithm of the RMS residual without over that with the shift. Links and friction
        are fitted to the fitted rows alone. 0 without rows of either.
        """
        fit = self.eq.fit[self.rows]
        if fit.all() or not fit.any():
            return 0.0
        left = []
        for tau in (self.torque(0.0), self.torque(shift)):
            x = np.linalg.lstsq(self.basis[fit], tau[fit], rcond=c.RANK)[0]
            left.append(float(np.sum((tau[~fit] - self.basis[~fit] @ x) ** 2)))
        return float(np.log(max(left[0], 1e-300) / max(left[1], 1e-300))) / 2

    def causes(self) -> dict[str, Array]:
        """Return the columns of each cause, by its name in findings.yaml."""
        eq, k, rows = self.eq, self.k, self.rows
        q, v, load = eq.q[rows, k], eq.speed[rows, k], np.abs(eq.nominal[rows, k])
        slides = np.tanh(over_largest(v) / c.SIGN_WIDTH)
        q = q - q.mean()
        time = (eq.time[rows] + 1e3 * eq.source[rows]) / max(float(eq.time.max()), 1e-9)
        near = [eq.v[:, [k]] + sign * eq.v[:, [j]]
                for j in (k - 1, k + 1) if 0 <= j < eq.n for sign in (1, -1)]  # fmt: skip
        both = over_largest(np.hstack(near or [eq.v[:, [k]]]))[rows]
        built = [_built_up(eq, k, share)[rows] for share in c.BUILT_UP]
        return {
            "late": self.torque(0.0, 1)[:, None],
            "springs": self.torque(0.0, 2)[:, None],
            "hysteresis": np.column_stack(built),
            "position": np.column_stack(
                [np.sin(q), np.cos(q), np.sin(2 * q), np.cos(2 * q), q, q**2, q**3]
            ),
            "load": np.column_stack([load * slides, load * v]),
            "coupled": np.hstack([both, np.tanh(both / c.SIGN_WIDTH)]),
            "drift": np.column_stack([time * slides, time * v, time**2 * slides]),
        } | ({} if self.links is None else {"links": self.links[rows, k]})


def _delay(joints: Sequence[Joint], most: float) -> tuple[float, float, float]:
    """Return a delay up to `most` [s], its standard error [s], and the share of the residual²."""
    d = 0.0
    parts = []
    for _ in range(c.DELAY_ROUNDS):
        parts = [one.seen(d) for one in joints]
        sums = _sums(parts)
        step = -float(sums[:, 0].sum() / max(sums[:, 1].sum(), 1e-300))
        d = float(np.clip(d + step, -most, most))
    if not parts:
        return 0.0, np.inf, 0.0
    before, after = (np.array([np.sum(one.seen(at)[0] ** 2) for one in joints]) for at in (0.0, d))
    gain = 1 - float(np.mean(after / np.maximum(before, 1e-300)))
    rest = sums.sum(axis=0) - sums  # without a block
    apart = -rest[:, 0] / np.maximum(rest[:, 1], 1e-300)
    error = float(np.sqrt((len(apart) - 1) * np.var(apart)))
    return d, error, gain


def _sums(parts: Sequence[tuple[Array, Array]]) -> Array:
    """Return sums of residual times slope and of squared slope in blocks of time.

    Joints are weighted by their residuals. Shape (BLOCKS, 2).
    """
    sums = np.zeros((c.BLOCKS, 2))
    for left, slope in parts:
        products = np.column_stack([left * slope, slope**2])
        products /= max(float(np.mean(left**2)), 1e-300)
        sums += [rows.sum(axis=0) for rows in np.array_split(products, c.BLOCKS)]
    return sums


def _built_up(eq: Equations, k: int, share: float) -> Array:
    """Return friction that builds up over an angle after each reversal, from -1 to 1, shape (M,).

    The angle is a share of the joint's range.
    """
    q = eq.angle[:, k]
    steps = np.diff(q, prepend=q[0]) / max(share * float(np.ptp(q)), 1e-12)
    steps[np.flatnonzero(np.diff(eq.part, prepend=eq.part[0]))] = 0.0
    return np.array(list(accumulate(steps.tolist(), lambda z, step: min(1.0, max(-1.0, z + step)))))
