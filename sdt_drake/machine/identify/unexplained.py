"""What rigid links and friction leave, and what it looks like: torques that are recorded late,
springs, hysteresis, something that acts on a position, friction that changes.

Links and friction of each joint are free here, and are taken out of all that is compared. A cause
is told by the share of the rest (its square) that columns of that cause explain. A delay d of the
torques makes tau(t + d) what links and friction explain, which is solved by Gauss and Newton's
method; its interval is that of the jackknife over blocks of time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from sdt_drake.io.arrays import Array, Index
from sdt_drake.machine.identify.equations import Equations

_BLOCKS, _SURE = 10, 5.0  # of time; standard errors of a delay that is told
_SHORTEST = 2e-3  # s, of a delay that is told
_GAIN = 0.01  # of the square of what is left, by a delay that is told
_ROUNDS = 4
_FARTHEST = 0.35  # of a period of what is compared: beyond, no delay is found by a slope
_APART = 0.7  # of a delay: joints agree that differ by less
_LITTLE, _SOME, _MUCH = 0.03, 0.06, 0.3  # of a torque, left: more has a name
_EXPLAINS, _CLEARLY, _AS_WELL = 0.6, 0.75, 0.12  # of the square of what is left
_LATE = 0.25  # likewise, by a delay that is sure
_RANK = 1e-7
_BUILT_UP = (0.003, 0.01, 0.03)  # of a joint's reach, over which friction builds up

CAUSES = {
    "late": "a torque that is recorded late",
    "springs": "springs in its gear",
    "hysteresis": "play or friction that builds up over an angle at reversals",
    "position": "something that acts on its position, as a counterbalance or a cable",
    "load": "friction that grows with the torque",
    "drift": "friction that changed within the recording, as with temperature",
}
"""Causes of what is left, in words."""


@dataclass(frozen=True, eq=False)
class Delay:
    """How late torques are recorded [s]: of all joints, and of each, with standard errors.

    Attributes:
        common, error: of all.
        each, errors: shape (n,); NaN of a joint that does not move.
        gain: share of the square of what is left that the common one explains.
    """

    common: float
    error: float
    each: Array
    errors: Array
    gain: float

    @property
    def is_told(self) -> bool:
        """Whether it is sure, worth to be corrected, and that of the joints: they agree, and half
        of them tell it alone."""
        known = np.isfinite(self.each)
        each, errors = self.each[known], self.errors[known]
        is_sure = abs(self.common) > max(_SURE * self.error, _SHORTEST) and self.gain > _GAIN
        agree = np.abs(each - self.common) < np.maximum(4 * errors, _APART * abs(self.common))
        by_itself = each * np.sign(self.common) > 3 * errors
        return bool(is_sure and agree.all() and by_itself.mean() >= 0.5)

    @property
    def words(self) -> str:
        """With 95 % intervals."""
        each = ", ".join(
            "–" if np.isnan(d) else f"{1e3 * d:.1f} ± {2e3 * e:.1f}"
            for d, e in zip(self.each, self.errors, strict=True)
        )
        return f"{1e3 * self.common:.1f} ± {2e3 * self.error:.1f} ms, by joints {each} ms"


def delay_of(eq: Equations, cutoff: float) -> Delay:
    """How late torques are recorded; cutoff: below which they are compared [Hz]."""
    joints = [_Joint(eq, k) for k in range(eq.n)]
    common = _delay([one for one in joints if one.moves], cutoff)
    each = [_delay([one], cutoff) if one.moves else (np.nan, np.nan, 0.0) for one in joints]
    return Delay(
        *common[:2], np.array([d for d, *_ in each]), np.array([e for _, e, _ in each]), common[2]
    )


def unexplained(eq: Equations, delay: Delay) -> Iterator[str]:
    """What links and friction leave of each joint, in sentences; a common delay that is told is
    taken out before."""
    for k in range(eq.n):
        one = _Joint(eq, k)
        if not one.moves:
            continue
        left, _ = one.seen(delay.common if delay.is_told else 0.0)
        size = float(left @ left)
        share = float(np.sqrt(size / max(one.spread, 1e-300)))
        explains = {name: _explained(left, one.without(C)) for name, C in one.causes().items()}
        best = max(explains.values())
        apart = abs(delay.each[k] - (delay.common if delay.is_told else 0.0))
        is_late = explains["late"] > max(_LATE, best - _AS_WELL) and apart > max(
            _SURE * delay.errors[k], _SHORTEST
        )
        told = f"joint {k + 1}: {100 * share:.0f} % of its torque is no rigid link and no friction"
        has_name = share > _LITTLE and best > (_EXPLAINS if share > _SOME else _CLEARLY)
        if not is_late and not has_name:
            if share > _MUCH:
                yield told
            continue
        likely = sorted(
            (name for name in explains if explains[name] > best - _AS_WELL),
            key=lambda name: -explains[name],
        )
        words = [CAUSES[name] for name in likely]
        if "late" in likely:
            d, e = delay.each[k], delay.errors[k]
            words[likely.index("late")] = f"a torque that is {1e3 * d:.1f} ± {2e3 * e:.1f} ms late"
        one_of = "one of " * (len(words) > 1) + "; ".join(words)
        yield f"{told}; {100 * best:.0f} % of that (of its square) looks like {one_of}"


class _Joint:
    """Torque of a joint over the stretches of a recording, links and friction taken out."""

    def __init__(self, eq: Equations, k: int):
        self.eq, self.k = eq, k
        counts = eq.moves[:, k]
        self.moves = bool(counts.mean() > 0.05 and counts.sum() > 50)
        if not self.moves:
            return
        self.rows = np.flatnonzero(counts)
        X = np.column_stack([eq.rigid[:, k], eq.friction[:, k]])[self.rows]
        X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
        U, size, _ = np.linalg.svd(X, full_matrices=False)
        self.basis = U[:, size > _RANK * size[0]]
        tau = eq.tau[self.rows, k]
        self.spread = float(np.sum((tau - tau.mean()) ** 2))
        self.splines: list[tuple[Index, BSpline]] = []
        for part in np.unique(eq.part):
            at = np.flatnonzero(eq.part == part)
            if len(at) > 5:
                self.splines.append((at, make_interp_spline(eq.time[at], eq.tau[at, k], k=5)))

    def without(self, values: Array) -> Array:
        """Of columns (or one) in the rows where the joint moves, what is no link and no
        friction."""
        return np.asarray(values - self.basis @ (self.basis.T @ values))

    def torque(self, shift: float, order: int = 0) -> Array:
        """The torque, or a derivative of it, at a later time; in the rows where it moves."""
        whole = np.zeros(len(self.eq.tau))
        for at, spline in self.splines:
            time = np.clip(self.eq.time[at] + shift, self.eq.time[at[0]], self.eq.time[at[-1]])
            whole[at] = spline(time, order)
        return whole[self.rows]

    def seen(self, shift: float) -> tuple[Array, Array]:
        """What is left of the torque at a later time, and of its slope."""
        return self.without(self.torque(shift)), self.without(self.torque(shift, 1))

    def causes(self) -> dict[str, Array]:
        """Columns of each of CAUSES."""
        eq, k, rows = self.eq, self.k, self.rows
        q, v, load = eq.q[rows, k], eq.v[rows, k], np.abs(eq.nominal[rows, k])
        slides = np.tanh(v / max(0.05 * float(np.abs(v).max()), 1e-12))
        q = q - q.mean()
        time = (eq.time[rows] + 1e3 * eq.source[rows]) / max(float(eq.time.max()), 1e-9)
        built = [_built_up(eq, k, share)[rows] for share in _BUILT_UP]
        return {
            "late": self.torque(0.0, 1)[:, None],
            "springs": self.torque(0.0, 2)[:, None],
            "hysteresis": np.column_stack(built),
            "position": np.column_stack(
                [np.sin(q), np.cos(q), np.sin(2 * q), np.cos(2 * q), q, q**2, q**3]
            ),
            "load": np.column_stack([load * slides, load * v]),
            "drift": np.column_stack([time * slides, time * v, time**2 * slides]),
        }


def _delay(joints: Sequence[_Joint], cutoff: float) -> tuple[float, float, float]:
    """Delay, its standard error, and the share of the square of what is left that it explains."""
    most, d = _FARTHEST / cutoff, 0.0
    parts = []
    for _ in range(_ROUNDS):
        parts = [one.seen(d) for one in joints]
        sums = _sums(parts)
        step = -float(sums[:, 0].sum() / max(sums[:, 1].sum(), 1e-300))
        d = float(np.clip(d + step, -most, most))
    if not parts:
        return 0.0, np.inf, 0.0
    before, after = (np.array([np.sum(one.seen(at)[0] ** 2) for one in joints]) for at in (0.0, d))
    gain = 1 - float(np.mean(after / np.maximum(before, 1e-300)))
    apart = [
        -(sums[:, 0].sum() - a) / max(sums[:, 1].sum() - b, 1e-300) for a, b in sums
    ]  # without a block
    error = float(np.sqrt((len(apart) - 1) * np.var(apart)))
    return d, error, gain


def _sums(parts: Sequence[tuple[Array, Array]]) -> Array:
    """Of each block of time what is left times the slope, and the square of that, each joint by
    what it leaves, shape (_BLOCKS, 2)."""
    sums = np.zeros((_BLOCKS, 2))
    for left, slope in parts:
        weight = _weight(left)
        for b, rows in enumerate(np.array_split(np.arange(len(left)), _BLOCKS)):
            sums[b] += (
                left[rows] @ slope[rows] / weight,
                slope[rows] @ slope[rows] / weight,
            )
    return sums


def _weight(left: Array) -> float:
    return max(float(np.mean(left**2)), 1e-300)


def _explained(left: Array, columns: Array) -> float:
    """Share of the square of what is left that columns explain."""
    Q, R = np.linalg.qr(columns)
    used = np.abs(np.diagonal(R)) > _RANK * max(float(np.abs(R).max()), 1e-300)
    return float(np.sum((Q[:, used].T @ left) ** 2) / max(float(left @ left), 1e-300))


def _built_up(eq: Equations, k: int, share: float) -> Array:
    """Friction that builds up over a share of the joint's reach after each reversal, from -1 to 1,
    shape (M,)."""
    q = eq.q[:, k]
    steps = np.diff(q, prepend=q[0]) / max(share * float(np.ptp(q)), 1e-12)
    steps[np.flatnonzero(np.diff(eq.part, prepend=eq.part[0]))] = 0.0
    built, z = [], 0.0
    for step in steps.tolist():
        z = min(1.0, max(-1.0, z + step))
        built.append(z)
    return np.array(built)
