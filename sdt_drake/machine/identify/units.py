"""In which unit recorded torques are, by those of the file's links."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.io.shown import listed
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.robot.robot import Robot

_ALIKE = 0.8  # correlation with the file's torque, from where on a joint tells the unit
_OFF = np.log(3.0)  # of a ratio: links of a file may be wrong by so much
_GEAR = 3.0  # a lower gear ratio is taken for wrong links
_SPREAD = np.log(1.6)  # of what one unit explains: between joints
_CLEARLY = np.log(1.5)  # nearer than others
_RATED = {1000.0: "per mille", 100.0: "percent"}
_PEAKS = (0.8, 4.5)  # times the rated torque


class Unit(NamedTuple):
    """A unit that torques seem to have.

    Attributes:
        text: a sentence.
        factor: what turns them into N m, joint side, shape (n,).
        is_exact: whether the unit has a size of its own, as kN m.
    """

    text: str
    factor: Array
    is_exact: bool = False


def torque_unit(robot: Robot, eq: Equations) -> Unit | None:
    """The unit of torques that are not as large as those of the file's links, by one name for all
    joints that tell; None where they are as large, or nothing tells."""
    slopes, alike = _slopes(eq)
    own = np.log(np.maximum(np.abs(slopes), 1e-300))
    off = np.flatnonzero((np.abs(alike) > _ALIKE) & (np.abs(own) > _OFF))
    if not len(off):
        return None
    ratio, limit = robot.gear_ratio, robot.effort_limit
    names = listed([f"tau_{k + 1}" for k in off.tolist()])
    about = f"{names}: about {_range(slopes[off])} times the torque of the file"
    exact = {"in kN m": np.full(robot.n, 1e-3), "in N mm": np.full(robot.n, 1e3)}
    if np.all(ratio[off] > _GEAR):
        exact |= {"of the motors": 1 / ratio, "of the joints": ratio}
    far = {
        words: float(np.sqrt(np.mean((own[off] - np.log(value[off])) ** 2)))
        for words, value in exact.items()
    }
    fits = [words for words in sorted(far, key=lambda x: far[x]) if far[words] < _OFF]
    rated = own[off] + np.log(limit[off])  # of a share of what motors have, all alike
    shares = [
        unit
        for unit in _RATED
        if _PEAKS[0] < np.exp(np.median(rated)) / unit < _PEAKS[1] and np.ptp(rated) < 2 * _SPREAD
    ]
    if shares and len(off) > 1 and (not fits or np.std(rated) < far[fits[0]] - _CLEARLY):
        factor = _factor(off, np.exp(np.median(rated)) / limit, robot.n)
        text = f"in {_RATED[shares[0]]} of a rated torque? Then torque_factor is the rated torque, "
        text += f"joint side, over {shares[0]:g}: by the file about {_list(factor)}"
        return Unit(f"{about}: {text}", factor)
    if not fits:
        factor = _factor(off, np.exp(own), robot.n)
        text = (
            "a current, or another unit? Then torque_factor turns it into N m; by the file it is "
        )
        return Unit(f"{about}: {text}about {_list(factor)} in the mapping file", factor)
    good = [words for words in fits if far[words] < far[fits[0]] + _CLEARLY]
    factor = _factor(off, exact[good[0]], robot.n)
    text = " or ".join(f"{words}{_write(words, _factor(off, exact[words], robot.n))}"
                       for words in good)  # fmt: skip
    return Unit(f"{about}: {text}?", factor, True)


def _write(words: str, factor: Array) -> str:
    """What to write for an exact unit."""
    side = {"of the motors": "motor", "of the joints": "joint"}.get(words)
    told = f"--side {side}" if side else f"torque_factor: {_list(factor)} in the mapping file"
    return f" ({told})"


def _slopes(eq: Equations) -> tuple[Array, Array]:
    """Slope of each torque over the file's, and their correlation, shape (n,); what friction may
    explain is taken out of both."""
    slopes, alike = np.zeros(eq.n), np.zeros(eq.n)
    for k in range(eq.n):
        rows = eq.moves[:, k] & eq.fit
        if rows.sum() < 10:
            continue
        v = eq.v[rows, k] / max(float(np.abs(eq.v[rows, k]).max()), 1e-12)
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
    """One over the size of a unit for joints that are off, 1 for others, shape (n,)."""
    return np.where(np.isin(np.arange(n), off), 1 / size, 1.0)


def _range(values: Array) -> str:
    least, most = np.abs(values).min(), np.abs(values).max()
    return f"{least:.3g}" if most < 1.2 * least else f"{least:.3g} to {most:.3g}"


def _list(values: Array) -> str:
    return f"[{', '.join(f'{x:.4g}' for x in values)}]"
