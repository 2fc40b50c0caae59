"""What looks wrong in recordings: units, sides, signs, order, saturation, play, too little
motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sdt_drake.io.arrays import Array, Mask
from sdt_drake.io.shown import listed
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.robot.robot import Robot

_UNEXPLAINED = 0.3  # of the torque: whatever moved, it was not this robot
_UNITS = {"kN m": 1e3, "N mm": 1e-3}  # N m
_UNIT_RATIO = 300.0  # of a gear; from there on it could be taken for a unit
_AT_REVERSALS = 3.0  # times what is left elsewhere
_AFTER = 0.15  # s, of a reversal
_WORSE, _FEW = 1.15, 0.01  # times what base parameters leave, and of the torque: worth a word
_FELT = 0.1  # of a torque, that is friction
_SURE = 0.5  # of what was believed before: less is no news
_WEAK = 300.0  # condition number


def suspicious_torques(
    robot: Robot, eq: Equations, predicted: Array, friction: Array
) -> Iterator[str]:
    """What the torques say against the robot's file, and what a fit leaves, in sentences.

    Args:
        robot: of the file.
        eq: the equations.
        predicted: torque after the fit [N m], shape (M, n).
        friction: what of it is friction, shape (M, n).
    """
    still = [k for k in range(robot.n) if eq.moves[:, k].mean() < 0.05]
    for k in still:
        yield f"joint {k + 1} stands still: nothing is said of its friction and its motor"
    yield from _seen_on_one_side(eq, still)
    slopes, alike = _against_nominal(eq)
    drives = _driving(eq, friction)
    own = np.where((np.diagonal(alike) > 0.5) & (robot.gear_ratio < _UNIT_RATIO), slopes, 0.0)
    in_units = {unit: (own * x > 1 / 3) & (own * x < 3) for unit, x in _UNITS.items()}
    yield from (_in_unit(unit, found) for unit, found in in_units.items() if found.any())
    for k in range(robot.n):
        ratio, s = float(robot.gear_ratio[k]), float(slopes[k])
        if any(found[k] for found in in_units.values()):
            continue
        if drives[k] < -_FELT or (alike[k, k] < -0.5 and drives[k] < 0):
            against = "goes against the torque of the file, and " * bool(alike[k, k] < -0.5)
            yield (
                f"tau_{k + 1} {against}drives as no friction does: sign of tau_{k + 1} or of "
                f"q_{k + 1} (direction in the mapping file)?"
            )
        elif ratio > 3 and alike[k, k] > 0.5 and 1 / 3 < s * ratio < 3:
            yield (
                f"tau_{k + 1} is {s:.3g} of the torque of the file, about 1 / {ratio:g}, the gear "
                "ratio: is it that of the motor? (--side motor)"
            )
        elif ratio > 3 and alike[k, k] > 0.5 and 1 / 3 < s / ratio < 3:
            yield (
                f"tau_{k + 1} is {s:.3g} times the torque of the file, about the gear ratio "
                f"{ratio:g}: is it that of the joint? (--side joint)"
            )
        other = int(alike[k].argmax())
        if other != k and alike[k, other] > max(0.9, alike[k, k] + 0.3) and other not in still:
            yield (
                f"tau_{k + 1} looks like the torque of joint {other + 1}: are the columns in the "
                "order of the joints, base to tip?"
            )
    yield from _left_over(eq, predicted, still)


def _in_unit(unit: str, found: Mask) -> str:
    """The sentence on joints whose torques seem to be in a unit of _UNITS, shape (n,)."""
    names = listed([f"tau_{k + 1}" for k in np.flatnonzero(found)])
    factors = ", ".join(f"{_UNITS[unit] if one else 1:g}" for one in found)
    return (
        f"{names}: about {1 / _UNITS[unit]:g} times the torque of the file: in {unit}? "
        f"(torque_factor: [{factors}] in the mapping file)"
    )


def _seen_on_one_side(eq: Equations, still: Sequence[int]) -> Iterator[str]:
    """Joints that move where others are fitted or judged by, but not they."""
    for k in range(eq.n):
        fitted, judged = (np.any(eq.moves[rows, k]) for rows in (eq.fit, ~eq.fit))
        if k not in still and not judged:
            yield f"joint {k + 1} stands still in all that is held out: nothing judges its torque"
        elif k not in still and not fitted:
            yield (
                f"joint {k + 1} stands still but in what is held out: nothing is said of its "
                "friction and its motor"
            )


def _driving(eq: Equations, friction: Array) -> Array:
    """How much of each torque is friction that brakes, below 0 that drives, shape (n,): a tool that
    the file does not have may turn its torque round, but friction has one sign."""
    rows = eq.moves & eq.fit[:, None]
    size = np.sqrt(np.sum(rows * eq.v**2, axis=0) * np.sum(rows * eq.tau**2, axis=0))
    return np.asarray(np.sum(rows * friction * eq.v, axis=0) / np.maximum(size, 1e-300))


def _against_nominal(eq: Equations) -> tuple[Array, Array]:
    """Slope of each measured torque over the file's, and how alike every pair is, shape (n, n);
    what a constant and the sign of the speed say is taken out of both."""
    measured, nominal = np.array(eq.tau), np.array(eq.nominal)
    alike = np.zeros((eq.n, eq.n))
    for j in range(eq.n):
        known = np.column_stack([np.ones(len(eq.tau)), np.tanh(eq.v[:, j] / 0.02), eq.v[:, j]])
        out = np.linalg.pinv(known)
        own = measured[:, j] - known @ (out @ measured[:, j])
        for k in range(eq.n):
            other = nominal[:, k] - known @ (out @ nominal[:, k])
            size = np.linalg.norm(own) * np.linalg.norm(other)
            alike[j, k] = own @ other / size if size > 0 else 0.0
    size = np.maximum(np.sum((nominal - nominal.mean(axis=0)) ** 2, axis=0), 1e-300)
    slopes = np.sum((nominal - nominal.mean(axis=0)) * measured, axis=0) / size
    return slopes, alike


def _left_over(eq: Equations, predicted: Array, still: Sequence[int]) -> Iterator[str]:
    left = eq.tau - predicted
    for k in range(eq.n):
        if k in still:
            continue
        rows = eq.moves[:, k]
        share = float(np.std(left[rows, k]) / max(np.std(eq.tau[rows, k]), 1e-300))
        turned = np.flatnonzero(np.diff(np.sign(eq.v[:, k])) != 0)
        near = np.zeros(len(eq.time), dtype=bool)
        for row in turned:
            near |= (np.abs(eq.time - eq.time[row]) < _AFTER) & (eq.part == eq.part[row])
        if share > _UNEXPLAINED:
            told = f"{100 * share:.0f} % of its torque"
            yield f"joint {k + 1}: {told} is no rigid link and no friction"
        elif len(turned) > 4 and share > 0.02 and near.mean() < 0.5:
            ratio = np.std(left[near, k]) / max(np.std(left[~near & rows, k]), 1e-300)
            if ratio > _AT_REVERSALS:
                yield (
                    f"joint {k + 1}: what is left is {ratio:.1f} times as large within "
                    f"{_AFTER:g} s of its reversals: play or springs in its gear, friction at "
                    "rest, or torques that are recorded late (torque_delay in the mapping file)"
                )


def inconsistent(eq: Equations, least: Array, consistent: Array) -> Iterator[str]:
    """Joints of which links that can be explain less than the base parameters, free of bodies."""
    size = np.std(eq.tau[eq.fit], axis=0)
    for k in range(eq.n):
        left = [np.std((eq.tau - x)[eq.fit, k]) / size[k] for x in (least, consistent)]
        if left[1] > max(_WORSE * left[0], left[0] + _FEW):
            yield (
                f"joint {k + 1}: links that can be leave {100 * left[1]:.1f} % of its torque, "
                f"base parameters that no body need have {100 * left[0]:.1f} %"
                + ": something else acts there, such as a counterbalance, a spring or a cable"
                * bool(left[1] > max(2 * left[0], 0.1))
            )


def weakly_excited(
    condition: float, before: Array, after: Array, words: Sequence[str]
) -> list[str]:
    """What a motion says too little of.

    Args:
        condition: of the scaled equations.
        before, after: standard deviations of the base parameters, shape (r,).
        words: what these are.
    """
    weak = [words[i] for i in np.flatnonzero(after > _SURE * before).tolist()]
    said = []
    if condition > _WEAK:
        said.append(
            f"too little excitation: condition number {condition:.3g}, expected below {_WEAK:g}"
        )
    if weak:
        names = ", ".join(text.split(" + ")[0].split(" - ")[0] for text in weak[:4])
        more = f" and {len(weak) - 4} more" if len(weak) > 4 else ""
        said.append(
            f"{len(weak)} of {len(words)} base parameters are hardly excited, and stay as in the "
            f"file: those named after {names}{more}"
        )
    return said
