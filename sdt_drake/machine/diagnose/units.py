"""The likely unit of recorded torques, by comparison with the torques of the file's links."""

from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.io.shown import listed
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose import explained
from sdt_drake.machine.diagnose.finding import Finding
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.robot.robot import Robot

_RATED = {1000.0: "per mille", 100.0: "percent"}


class Unit(NamedTuple):
    """The likely unit of torques."""

    finding: Finding
    """The finding."""
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
    off = np.flatnonzero((np.abs(alike) > c.ALIKE) & (np.abs(own) > np.log(c.WRONG_LINKS)))
    if not len(off):
        return None
    joints = tuple(k + 1 for k in off.tolist())
    sizes = np.abs(slopes[off])
    about = listed([f"tau_{k}" for k in joints])
    about += f": about {_range(sizes)} times the torque of the file"

    def unit(text: str, size: Array, remedy: str = "", *, is_exact: bool = False) -> Unit:
        evidence = {"least_times": float(sizes.min()), "most_times": float(sizes.max())}
        finding = Finding("unit", f"{about}: {text}", joints, evidence, remedy)
        return Unit(finding, _factor(off, size), is_exact)

    exact = {"in kN m": np.full(robot.n, 1e-3), "in N mm": np.full(robot.n, 1e3)}
    if np.all(robot.gear_ratio[off] > c.MIN_GEAR):
        exact |= {"of the motors": 1 / robot.gear_ratio, "of the joints": robot.gear_ratio}
    far = {
        words: float(np.sqrt(np.mean((own[off] - np.log(size[off])) ** 2)))
        for words, size in exact.items()
    }
    best = min(far, key=lambda words: far[words])
    wrong, clearly = np.log(c.WRONG_LINKS), np.log(c.CLEARLY_CLOSER)
    is_near = far[best] < wrong
    rated = own[off] + np.log(robot.effort_limit[off])  # equal, if in shares of a rated torque
    peak, spread = np.exp(np.median(rated)), np.log(c.SAME_UNIT)
    shares = [
        x for x in _RATED if c.PEAKS[0] < peak / x < c.PEAKS[1] and np.ptp(rated) < 2 * spread
    ]
    if shares and len(off) > 1 and (not is_near or np.std(rated) < far[best] - clearly):
        size = peak / robot.effort_limit
        text = f"is it in {_RATED[shares[0]]} of a rated torque? Then torque_factor is the rated "
        text += f"torque, joint side, over {shares[0]:g}, by the file about "
        return unit(text + explained.entries(_factor(off, size), 4), size)
    if not is_near:
        text = "is it a current, or in another unit? Then torque_factor turns it into N m; by the "
        values = explained.entries(_factor(off, np.exp(own)), 4)
        text += f"file it is about {values} in the mapping file"
        return unit(text, np.exp(own))
    good = sorted(
        (x for x in far if far[x] < min(far[best] + clearly, wrong)), key=lambda x: far[x]
    )
    remedy = " or ".join(_remedy(words, _factor(off, exact[words])) for words in good)
    return unit(f"is it {' or '.join(good)}?", exact[best], remedy, is_exact=True)


def _remedy(words: str, factor: Array) -> str:
    """Return the entry of the mapping file for an exact unit."""
    side = {"of the motors": "motor", "of the joints": "joint"}.get(words)
    return f"side: {side}" if side else f"torque_factor: {explained.entries(factor, 4)}"


def _slopes(eq: Equations) -> tuple[Array, Array]:
    """Return slope and correlation of each torque over the file's, shape (n,).

    The part that friction can explain is removed from both torques.
    """
    slopes, alike = np.zeros(eq.n), np.zeros(eq.n)
    for k in range(eq.n):
        rows = eq.moves[:, k] & eq.fit
        if rows.sum() < 10:
            continue
        known = explained.basis(
            explained.like_friction(explained.over_largest(eq.speed[rows, k]), c.FRICTION_WIDTHS)
        )
        measured, file = explained.without(
            known, np.stack([eq.tau[rows, k], eq.nominal[rows, k]], 1)
        ).T
        sizes = np.linalg.norm(measured), np.linalg.norm(file)
        if min(sizes) > 0:
            slopes[k] = measured @ file / sizes[1] ** 2
            alike[k] = measured @ file / (sizes[0] * sizes[1])
    return slopes, alike


def _factor(off: Index, size: Array) -> Array:
    """Return one over the size of a unit for joints `off`, 1 for others, shape (n,)."""
    return np.where(np.isin(np.arange(len(size)), off), 1 / size, 1.0)


def _range(sizes: Array) -> str:
    least, most = sizes.min(), sizes.max()
    return f"{least:.3g}" if most < 1.2 * least else f"{least:.3g} to {most:.3g}"
