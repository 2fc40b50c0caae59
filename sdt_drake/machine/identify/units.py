"""The likely unit of recorded torques, by comparison with the torques of the file's links."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.io.shown import listed
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.robot.robot import Robot

_MIN_CORRELATION = 0.8  # of measured and file's torque, for a joint to show the unit
_OFF = np.log(3.0)  # logarithm of the ratio that wrong links of a file may cause
_MIN_GEAR = 3.0  # gear ratio that wrong links cannot explain
_SPREAD = np.log(1.6)  # logarithm of the ratio between joints with the same unit
_CLEARLY = np.log(1.5)  # logarithm of the ratio by which the best unit is closer than others
_RATED = {1000.0: "per mille", 100.0: "percent"}
_PEAKS = (0.8, 4.5)  # largest torque over the rated torque, range of usual motors


class Unit(NamedTuple):
    """The likely unit of torques."""

    text: str
    """The suspicion as a sentence."""
    factor: Array
    """Factors to N m, joint side, shape (n,)."""
    is_exact: bool = False
    """True for a unit of known size, such as kN m."""


def torque_unit(robot: Robot, eq: Equations) -> Unit | None:
    """Return one likely unit for all torques with another size than those of the file's links.

    None if all torques have the size of the file's, or no joint shows the unit.
    """
    slopes, alike = _slopes(eq)
    own = np.log(np.maximum(np.abs(slopes), 1e-300))
    off = np.flatnonzero((np.abs(alike) > _MIN_CORRELATION) & (np.abs(own) > _OFF))
    if not len(off):
        return None
    ratio, limit = robot.gear_ratio, robot.effort_limit
    names = listed([f"tau_{k + 1}" for k in off.tolist()])
    about = f"{names}: about {_range(slopes[off])} times the torque of the file"
    exact = {"in kN m": np.full(robot.n, 1e-3), "in N mm": np.full(robot.n, 1e3)}
    if np.all(ratio[off] > _MIN_GEAR):
        exact |= {"of the motors": 1 / ratio, "of the joints": ratio}
    far = {
        words: float(np.sqrt(np.mean((own[off] - np.log(value[off])) ** 2)))
        for words, value in exact.items()
    }
    fits = [words for words in sorted(far, key=lambda x: far[x]) if far[words] < _OFF]
    rated = own[off] + np.log(limit[off])  # equal for all joints, if in shares of a rated torque
    shares = [
        unit
        for unit in _RATED
        if _PEAKS[0] < np.exp(np.median(rated)) / unit < _PEAKS[1] and np.ptp(rated) < 2 * _SPREAD
    ]
    if shares and len(off) > 1 and (not fits or np.std(rated) < far[fits[0]] - _CLEARLY):
        factor = _factor(off, np.exp(np.median(rated)) / limit, robot.n)
        text = f"is it in {_RATED[shares[0]]} of a rated torque? Then torque_factor is the rated "
        text += f"torque, joint side, over {shares[0]:g}, by the file about {_list(factor)}"
        return Unit(f"{about}: {text}", factor)
    if not fits:
        factor = _factor(off, np.exp(own), robot.n)
        text = "is it a current, or in another unit? Then torque_factor turns it into N m; by the "
        text += f"file it is about {_list(factor)} in the mapping file"
        return Unit(f"{about}: {text}", factor)
    good = [words for words in fits if far[words] < far[fits[0]] + _CLEARLY]
    factor = _factor(off, exact[good[0]], robot.n)
    text = " or ".join(f"{words}{_write(words, _factor(off, exact[words], robot.n))}"
                       for words in good)  # fmt: skip
    return Unit(f"{about}: is it {text}?", factor, True)


def _write(words: str, factor: Array) -> str:
    """Return the option or mapping entry for an exact unit, in parentheses."""
    side = {"of the motors": "motor", "of the joints": "joint"}.get(words)
    entry = f"--side {side}" if side else f"torque_factor: {_list(factor)} in the mapping file"
    return f" ({entry})"


def _slopes(eq: Equations) -> tuple[Array, Array]:
    """Return slope and correlation of each torque over the file's, shape (n,).

    The part that friction can explain is removed from both torques.
    """
    slopes, alike = np.zeros(eq.n), np.zeros(eq.n)
    for k in range(eq.n):
        rows = eq.moves[:, k] & eq.fit
        if rows.sum() < 10:
            continue
        v = eq.speed[rows, k] / max(float(np.abs(eq.speed[rows, k]).max()), 1e-12)
        known = np.column_stack([np.ones_like(v), v, np.tanh(v / 0.02), np.tanh(v / 0.1)])
        both = np.column_stack([eq.tau[rows, k], eq.nominal[rows, k]])
        Q, _ = np.linalg.qr(known)
        measured, file = (both - Q @ (Q.T @ both)).T
        sizes = np.linalg.norm(measured), np.linalg.norm(file)
        if min(sizes) > 0:
            slopes[k] = measured @ file / sizes[1] ** 2
            alike[k] = measured @ file / (sizes[0] * sizes[1])
    return slopes, alike


def _factor(off: Index, size: Array, n: int) -> Array:
    """Return one over the size of a unit for joints `off`, 1 for others, shape (n,)."""
    return np.where(np.isin(np.arange(n), off), 1 / size, 1.0)


def _range(values: Array) -> str:
    least, most = np.abs(values).min(), np.abs(values).max()
    return f"{least:.3g}" if most < 1.2 * least else f"{least:.3g} to {most:.3g}"


def _list(values: Array) -> str:
    return f"[{', '.join(f'{x:.4g}' for x in values)}]"
