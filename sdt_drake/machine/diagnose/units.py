"""The likely unit of recorded torques, by comparison with the torques of the file's links.

A joint shows the unit as far as errors of the file cannot explain another size. The measured
torque is s times that of the file. Errors of the file's links spread log s by log(1 + E / f). Here
f is the torque of the file over the torque that links of this size typically have. A wrist whose
centre of mass is on its axis has f near 0 and shows nothing, a shoulder that carries the arm has f
near 1. A unit is one factor for all joints, so their squared distances over the spread are summed.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array, Index, Mask
from sdt_drake.io.shown import listed
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose import explained
from sdt_drake.machine.diagnose.finding import Finding
from sdt_drake.machine.identify.base_parameters import motor_parameters, rigid_columns
from sdt_drake.machine.identify.consistency import rigid_scale
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.robot.robot import Robot

SHARES = {"percent": 100.0, "per mille": 1000.0}
"""Numbers that stand for a whole rated torque."""

_SIDES = {"of the motors": "motor", "of the joints": "joint"}


class Unit(NamedTuple):
    """The likely unit of torques."""

    finding: Finding
    """The finding."""
    factor: Array
    """Factors to N m, joint side, shape (n,)."""
    is_exact: bool = False
    """True for a unit of known size, such as kN m."""


@dataclass(frozen=True, eq=False)
class _Sizes:
    """Measured torques over those of the file, without what friction can explain."""

    size: Array
    """Logarithm of the ratio, shape (n,)."""
    spread: Array
    """Standard deviation of the logarithm by errors of the file; inf for joints that show nothing,
    shape (n,)."""

    @property
    def off(self) -> Mask:
        """Mask of the joints whose ratio links cannot explain, shape (n,)."""
        is_large = np.abs(self.size) > np.log(c.WRONG_LINKS)
        return np.asarray(is_large & (np.abs(self.size) > c.SIZE_SIGMAS * self.spread))

    def misses(self, size: Array) -> float:
        """Return the sum of squared distances from the ratios of a unit, over the spreads."""
        return float(np.sum(((self.size - np.log(size)) / self.spread) ** 2))

    def fits(self, size: Array, joints: Mask, most: float = c.WRONG_LINKS) -> bool:
        """Return True if errors of the file explain the distance from a unit of some joints.

        They explain a ratio of `most`, or two spreads.
        """
        far = np.abs(self.size - np.log(size))[joints]
        return bool(np.all(far < np.maximum(np.log(most), 2 * self.spread[joints])))


def torque_unit(robot: Robot, eq: Equations) -> Unit | None:
    """Return one likely unit for all torques with another size than those of the file's links.

    None if all torques have the size of the file's, or no joint shows the unit.
    """
    found, ones = _sizes(robot, eq), np.ones(robot.n)
    known, off = np.isfinite(found.spread), found.off
    scaled = {"in kN m": 1e-3 * ones, "in N mm": 1e3 * ones}
    geared = {"of the motors": 1 / robot.gear_ratio, "of the joints": robot.gear_ratio}
    shares = SHARES if np.isfinite(robot.effort_limit).all() else {}
    rated = {f"in {name} of the effort limit": x / robot.effort_limit for name, x in shares.items()}
    exact = scaled | (geared if np.all(robot.gear_ratio[off] > c.MIN_GEAR) else {}) | rated
    misses = {words: found.misses(size) for words, size in exact.items()}
    least = min(found.misses(ones) - c.UNIT_GAIN, min(misses.values()) + c.UNIT_TIE)
    good = [
        words
        for words in sorted(exact, key=lambda words: misses[words])
        if misses[words] < least
        and found.fits(exact[words], known, c.SAME_UNIT if words in rated else c.WRONG_LINKS)
    ]
    if good:
        text = f"is it {' or '.join(good)}{', or a current' * (good[0] in rated)}?"
        remedy = " or ".join(_remedy(words, 1 / exact[words]) for words in good)
        is_exact = good[0] not in rated
        return _unit(found, known, text, 1 / exact[good[0]], remedy, is_exact=is_exact)
    if not off.any():
        return None
    weight = 1 / found.spread**2
    limits = np.where(bool(shares), robot.effort_limit, 1.0)
    peak = float(np.exp(weight @ (found.size + np.log(limits)) / weight.sum()))
    for name, x in shares.items():
        size = peak / robot.effort_limit
        is_usual = c.PEAKS[0] < peak / x < c.PEAKS[1] and known.sum() > 1
        if is_usual and found.fits(size, known, c.SAME_UNIT):
            text = f"is it in {name} of a rated torque? Then torque_factor is the rated torque, "
            text += f"joint side, over {x:g}, by the file about {_entries(1 / size)}"
            return _unit(found, known, text, 1 / size)
    for words, size in scaled.items():
        if found.fits(size, off):  # of these joints alone
            factor = np.where(off, 1 / size, 1.0)
            return _unit(
                found, off, f"is it {words}?", factor, _remedy(words, factor), is_exact=True
            )
    factor = np.where(off, np.exp(-found.size), np.nan)
    others = known & ~off & (2 * found.spread < np.log(c.WRONG_LINKS))
    text = "is it a current, or in another unit? Then"
    if others.any():
        text = "others have its size. Is its gear ratio or its unit another one? Then"
    text += f" torque_factor turns it into N m; by the file it is about {_entries(factor)}"
    return _unit(found, off, f"{text} in the mapping file", np.where(off, factor, 1.0))


def _unit(
    found: _Sizes,
    joints: Mask,
    text: str,
    factor: Array,
    remedy: str = "",
    *,
    is_exact: bool = False,
) -> Unit:
    """Return a unit with its finding about some joints."""
    numbers, sizes = (np.flatnonzero(joints) + 1).tolist(), np.exp(found.size[joints])
    least, most = float(sizes.min()), float(sizes.max())
    about = f"{least:.3g}" if most < 1.2 * least else f"{least:.3g} to {most:.3g}"
    about = f"{listed([f'tau_{k}' for k in numbers])}: about {about} times the torque of the file"
    evidence = {"least_times": least, "most_times": most}
    sentence = f"{about}: {text}"
    return Unit(Finding("unit", sentence, tuple(numbers), evidence, remedy), factor, is_exact)


def _remedy(words: str, factor: Array) -> str:
    """Return the entry of the mapping file for an exact unit."""
    side = _SIDES.get(words)
    return f"side: {side}" if side else f"torque_factor: {_entries(factor)}"


def _entries(factor: Array) -> str:
    """Return factors as a list; "?" for those that nothing shows."""
    return explained.entries(factor, 4).replace("nan", "?")


def _sizes(robot: Robot, eq: Equations) -> _Sizes:
    """Return the measured torques over those of the file.

    The parts that friction, rotors that the file lacks and unknown links can explain are removed
    from both, unless all links are unknown.
    """
    rows: Index = np.flatnonzero(eq.fit & eq.moves.any(axis=1))
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, c.READING_ROWS).astype(int))]
    n, columns = robot.n, rigid_columns(robot, eq.q[rows], eq.v[rows], eq.vd[rows])
    typical = columns[:, :, : 10 * n] * rigid_scale(robot)[: 10 * n]
    motors = columns[:, :, 10 * n :] * (motor_parameters(robot) == 0)  # those that files lack
    size, spread = np.zeros(n), np.full(n, np.inf)
    for k in range(n):
        used = eq.moves[rows, k]
        if used.sum() < 10:
            continue
        at = rows[used]
        v = explained.over_largest(eq.speed[rows])[used, k]
        known = explained.like_friction(v, c.FRICTION_WIDTHS)
        known = np.column_stack([known, motors[used, k]])
        if np.any(eq.known):
            known = np.column_stack([known, eq.rigid[at, k]])
        parts = np.column_stack([eq.tau[at, k], eq.nominal[at, k], typical[used, k]])
        parts = explained.without(explained.basis(known), parts)
        measured, file, wide = parts[:, 0], parts[:, 1], float(np.linalg.norm(parts[:, 2:]))
        lengths = np.linalg.norm(measured), np.linalg.norm(file)
        product = float(measured @ file)
        if abs(product) > c.ALIKE * lengths[0] * lengths[1] > 0:
            size[k] = np.log(abs(product) / lengths[1] ** 2)
            spread[k] = np.log1p(c.LINK_ERRORS * wide / lengths[1])
    return _Sizes(size, spread)
