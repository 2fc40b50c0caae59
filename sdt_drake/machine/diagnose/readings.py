"""Alternative meanings of a recording's columns that explain the torques better than the mapping.

An alternative is one change: another order of torques, of positions or of both, a sign, an offset
of a position by a right angle, or another gravity. Of orders, all swaps are tested, and those that
`orders` finds. Each is tested twice, with free friction
at every joint: with the best links, and with the links of the file. A score is the logarithm of the
ratio of the residuals (RMS, before over after), summed over the joints. The two scores are added.
The spread over blocks of time gives the standard error.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose import explained
from sdt_drake.machine.diagnose.alternatives import Reading, alternatives, in_shares, other_orders
from sdt_drake.machine.diagnose.finding import Finding, finding
from sdt_drake.machine.diagnose.units import Unit, torque_unit
from sdt_drake.machine.identify.base_parameters import rigid_columns, rigid_parameters
from sdt_drake.machine.identify.consistency import rigid_scale
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.machine.identify.estimation import solved
from sdt_drake.machine.identify.regressor import Bodies
from sdt_drake.robot.robot import Robot

_LITTLE = 1e-3  # rad, for derivatives


class Residuals(NamedTuple):
    """Squared residuals over the mean square of the torque without friction."""

    free: Array
    """Residuals of the best links, shape (M, n)."""
    file: Array
    """Residuals of the links of the file, shape (M, n)."""
    links: Array
    """Parameters of the best links, shape (11 n,)."""
    size: Array
    """Mean squares of the torques without friction [(N m)²], shape (n,)."""


Proposal = tuple[Finding, Residuals]
"""A finding, with the residuals that are left if it is heeded."""


def misread(robot: Robot, eq: Equations) -> list[Finding]:
    """Return what speaks against the meaning of the columns and the robot's file.

    It is the likely unit of the torques, and better readings of the columns. A unit without a name
    is dropped if another reading explains the torques as they are. All are held against a tool
    that the file lacks: it replaces them if it explains the torques better, and is told beside
    them if they may be as good.
    """
    found = _proposals(robot, eq)
    tool = _tool(robot, eq, [left for _, left in found]) if found else None
    if tool is None:
        return [one for one, _ in found]
    is_better, told = tool
    return [told] if is_better else [*(one for one, _ in found), told]


def _proposals(robot: Robot, eq: Equations) -> list[Proposal]:
    """Return the unit, and the readings that explain the torques better, as `misread` tells."""
    unit, as_they_are = torque_unit(robot, eq), np.ones(robot.n)
    if unit is None:
        return better_readings(robot, eq, as_they_are) or _zeros_off(robot, eq)
    better = [] if unit.is_exact else better_readings(robot, eq, as_they_are, unit)
    left = _Judge(robot, eq, unit.factor).now
    return better or [(unit.finding, left), *better_readings(robot, eq, unit.factor)]


def _tool(
    robot: Robot, eq: Equations, proposed: Sequence[Residuals]
) -> tuple[bool, Finding] | None:
    """Return the finding of a tool that the file lacks, and True if it is better than proposals.

    It is a body at the last link, with ten free numbers. A unit has up to one for each joint; at
    READING_ROWS this difference is a tenth of a score by Schwarz's criterion (BIC). The score over
    a proposal is the least of two, with the file's other links and with the best ones. None if a
    proposal is better, if the body's mass were negative, or if it leaves much of a torque.
    """
    judge, last = _Judge(robot, eq, np.ones(robot.n)), slice(10 * (robot.n - 1), 10 * robot.n)
    free, alone = np.ones(11 * robot.n), np.full(11 * robot.n, c.FIXED)
    free[last] = alone[last] = c.LOOSER
    of_any, of_file = (judge.left(judge.plain, looser) for looser in (free, alone))
    mass = round(float(of_file.links[last][0] - judge.file[last][0]), 6)  # 0: not shown
    scores = [_score(*pair) for left in proposed
              for pair in ((left.file, of_file.free), (left.free, of_any.free))]  # fmt: skip
    least = min(scores, key=lambda one: float(one.mean()))
    score, error = float(least.mean()), float(least.std(ddof=1)) / np.sqrt(c.BLOCKS)
    before, left = _rms(judge.now.file), _rms(of_file.free)
    is_left = np.any(left[before > c.MIN_RESIDUAL] > c.MIN_RESIDUAL)
    if mass < 0 or score < -c.MAX_BEHIND or is_left:
        return None
    of = f" of about {mass:.2g} kg" * (mass > 0)
    k = int(np.argmax(before / left))
    link, shares = Bodies.of(robot).names[-1], {"left": float(left[k]), "before": float(before[k])}
    told = finding("payload", (k + 1,), of=of, link=link, mass_kg=mass, score=score, **shares)
    return score > max(c.MIN_FREE_SCORE, c.SCORE_SIGMAS * error), told


def better_readings(
    robot: Robot, eq: Equations, factor: Array, unnamed: Unit | None = None
) -> list[Proposal]:
    """Return the finding of the alternatives that explain the torques better than the mapping.

    An alternative is better if its total score is above MIN_SCORE. Its score with the best links is
    above MIN_FREE_SCORE, or its score with the links of the file is above MIN_FILE_SCORE. The
    second test has the higher limit because a file may be wrong. Beside a unit without a name, the
    links of the file do not decide, but another order of the columns suffices that leaves as little
    as the unit. The finding tells the best one and those that are nearly as good.

    Args:
        robot: The robot of the file.
        eq: The equations of the recordings.
        factor: Factors from each torque to N m, joint side, shape (n,).
        unnamed: A unit without a name, which the alternatives replace. It has one free number per
            joint, an order of the columns has none.

    Returns:
        One proposal, or none if the mapping explains the torques.
    """
    judge = _Judge(robot, eq, factor)
    plain, now = judge.plain, judge.now
    if np.all(_rms(now.file) < c.MIN_RESIDUAL):
        return []
    rival = None if unnamed is None else _Judge(robot, eq, unnamed.factor).now
    found = []
    others = [
        *other_orders(robot, judge.motion, judge.tau, judge.moves, plain),
        *judge.other_gravity(plain),
    ]
    if np.all(factor == 1) and not np.any(eq.known):  # a payload changes torques by definition
        others += in_shares(robot.effort_limit, judge.sizes(plain), plain)
    free = judge.left(plain, c.LOOSER)
    for reading in (*alternatives(plain), *others):
        is_share = reading.kind != "columns"
        left = judge.left(reading, c.LOOSER if is_share else 1.0)
        size = left.size / reading.sign**2
        rubs = np.log(now.size / size).sum() / 2  # more is friction of the right joints
        of_any = _score((free if is_share else now).free, left.free) + rubs
        of_file = _score(now.file, left.file) + rubs
        both = of_any + of_file
        score, error = float(both.mean()), both.std(ddof=1) / np.sqrt(c.BLOCKS)
        decides = of_any.mean() > c.MIN_FREE_SCORE or (
            rival is None
            and not is_share
            and of_any.mean() > -max(c.MIN_FREE_SCORE, c.MAX_FREE_LOSS * of_file.mean())
            and of_file.mean() > c.MIN_FILE_SCORE
        )
        is_clear = (decides and score > c.MIN_SCORE) or _is_as_good(reading, left, rival)
        if is_clear and score > c.SCORE_SIGMAS * error and of_file.mean() > 0:
            found.append((score, reading, left))
    return _best_of(found, now)


def _zeros_off(robot: Robot, eq: Equations) -> list[Proposal]:
    """Return the proposal of a position whose zero is off by some degrees.

    It must explain much more of at least two torques, and no less with the links of the file or
    with the best ones. It tells the positions whose zeros explain nearly as much.
    """
    judge = _Judge(robot, eq, np.ones(robot.n))
    plain, now = judge.plain, judge.now
    if np.all(_rms(now.file) < c.MIN_ZERO_RESIDUAL):
        return []
    found = []
    for reading in judge.other_zeros(plain):
        left = judge.left(reading)
        scores = _score(now.file, left.file), _score(now.free, left.free)
        both = np.sum(scores, axis=0)
        error = both.std(ddof=1) / np.sqrt(c.BLOCKS)
        gains = np.log(_rms(now.file) * _rms(now.free) / _rms(left.file) / _rms(left.free))
        is_clear = both.mean() > max(c.MIN_ZERO_SCORE, c.SCORE_SIGMAS * error)
        is_clear &= min(one.mean() for one in scores) >= 0 and sum(gains > c.MIN_ZERO_GAIN) > 1
        if is_clear and np.abs(reading.offset).max() >= np.radians(c.MIN_TILT):
            found.append((float(both.mean()), reading, left))
    return _best_of(found, now)


def _best_of(found: list[tuple[float, Reading, Residuals]], now: Residuals) -> list[Proposal]:
    """Return the proposal of the readings with the highest scores, and those nearly as good."""
    if not found:
        return []
    best, _, after = max(found, key=lambda one: one[0])
    readings = [one for score, one, _ in sorted(found, key=lambda one: -one[0])
                if score > best - c.MAX_BEHIND]  # fmt: skip
    return [(_in_words(readings, now, after, best), after)]


def _in_words(
    readings: Sequence[Reading], before: Residuals, after: Residuals, score: float
) -> Finding:
    """Return the finding of readings that explain the torques equally well."""
    left = {
        "file": _rms(after.file), "file_before": _rms(before.file),
        "any": _rms(after.free), "any_before": _rms(before.free),
    }  # fmt: skip
    gain = np.log(left["file_before"] / left["file"]) + np.log(left["any_before"] / left["any"])
    k = int(gain.argmax())
    evidence = {f"{name}_links": float(values[k]) for name, values in left.items()}
    words = "; or ".join(one.words for one in readings)
    remedy = "; or ".join(one.write for one in readings if one.write)
    return finding(readings[0].kind, (k + 1,), remedy, readings=words, score=score, **evidence)


def _is_as_good(reading: Reading, left: Residuals, rival: Residuals | None) -> bool:
    """Return True for another order, or no gravity, that leaves as little as a unit without a name.

    Neither has a free number.
    """
    is_in_order = np.array_equal(reading.order, np.arange(len(reading.order)))
    if rival is None or (is_in_order and reading.gravity.any()):
        return False
    score = _score(rival.free, left.free) + _score(rival.file, left.file)
    return bool(score.mean() > -c.MAX_BEHIND)


def _score(before: Array, after: Array) -> Array:
    """Return the score in each block of time, shape (BLOCKS,)."""
    blocks = np.array_split(np.arange(len(before)), c.BLOCKS)
    ratio = [before[b].mean(axis=0) / after[b].mean(axis=0) for b in blocks]
    return 0.5 * np.log(ratio).sum(axis=1)


def _rms(left: Array) -> Array:
    """Return the RMS over all rows, shape (n,)."""
    return np.asarray(np.sqrt(left.mean(axis=0)))


class _Judge:
    """A calculator of the residual torques of each alternative."""

    def __init__(self, robot: Robot, eq: Equations, factor: Array):
        fit = np.flatnonzero(eq.fit & eq.moves.any(axis=1))
        count = min(len(fit), c.READING_ROWS)
        few = fit[np.unique(np.linspace(0, len(fit) - 1, count).astype(int))]
        self.robot = robot
        self.motion = eq.q[few], eq.v[few], eq.vd[few]
        self.tau, self.moves = eq.tau[few] * factor, eq.moves[few]
        self.file = rigid_parameters(robot)
        self.scale = rigid_scale(robot)
        self.columns = rigid_columns(robot, *self.motion)
        order, ones = np.arange(robot.n), np.ones(robot.n)
        # The meaning that the mapping gives to the columns, and what it leaves.
        self.plain = Reading("", "", order, order, ones, ones, 0 * ones, Bodies.of(robot).gravity)
        self.now = self.left(self.plain)

    def left(self, reading: Reading, looser: float | Array = 1.0) -> Residuals:
        """Return the residuals of a reading, with best links that may be `looser` from the file."""
        seen = self._without_friction(reading)
        tau = reading.sign * self.tau[:, reading.order]
        floor = (c.RESIDUAL_FLOOR * tau) ** 2 + 1e-300
        size = np.array([np.mean(y**2) for _, y in seen]) + floor.mean(axis=0)
        n, free, links = len(seen), np.ones(len(seen)), self.file

        def of(phi: Array) -> Array:
            off = np.stack([y - Yk @ phi for Yk, y in seen], axis=1)
            return np.asarray((off**2 + floor.mean(axis=0)) / size)

        grams = [(Yk.T @ Yk, Yk.T @ y) for Yk, y in seen]
        for _ in range(c.READING_ROUNDS):
            belief = (looser * self.scale) ** -2
            H, h = np.diag(belief), self.file * belief
            for k in range(n):
                weight = 1 / (free[k] * size[k])
                H, h = H + weight * grams[k][0], h + weight * grams[k][1]
            links = solved(H, h)
            free = of(links).mean(axis=0)
        return Residuals(of(links), of(self.file), links, size)

    def sizes(self, reading: Reading) -> Array:
        """Return torques over those of the file's links, shape (n,); NaN for those unlike them."""
        sizes = np.full(len(self.motion[0].T), np.nan)
        for k, (Yk, y) in enumerate(self._without_friction(reading)):
            file = Yk @ self.file
            lengths = float(np.linalg.norm(y)), float(np.linalg.norm(file))
            if y @ file > c.ALIKE * lengths[0] * lengths[1] > 0:
                sizes[k] = y @ file / lengths[1] ** 2
        return sizes

    def other_gravity(self, plain: Reading) -> Iterator[Reading]:
        """Yield a reading with the direction of gravity that fits the torques best.

        The direction is fitted with the links of the file first, then with the best links. Torques
        are linear in gravity. Nothing if gravity is zero or has the direction of the file.
        """
        size = float(np.linalg.norm(plain.gravity))
        if size == 0:
            return
        reading, links = plain, self.file
        for _ in range(c.READING_ROUNDS):
            *units, nothing = (
                self._without_friction(replace(plain, gravity=x)) for x in (*np.eye(3), np.zeros(3))
            )
            A, b = np.zeros((3, 3)), np.zeros(3)
            for k, (Y0, y) in enumerate(nothing):
                X = np.column_stack([one[k][0] @ links - Y0 @ links for one in units])
                off = y - Y0 @ links
                weight = 1 / max(float(np.mean(y**2)), 1e-300)
                A, b = A + weight * X.T @ X, b + weight * X.T @ off
            along = np.asarray(np.linalg.lstsq(A, b, rcond=1e-9)[0])
            along = along * size / max(float(np.linalg.norm(along)), 1e-300)
            reading = replace(plain, gravity=along)
            links = self.left(reading).links
        cosine = float(reading.gravity @ plain.gravity) / size**2
        angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
        if angle < c.MIN_TILT:
            return
        stands = "upside down, as on a ceiling" if angle > 165 else f"turned by {angle:.0f} degrees"
        stands += ", as on a wall" * (75 < angle < 105)
        axis = ", ".join(f"{x + 0.0:.2f}" for x in np.round(reading.gravity / size, 2))
        yield replace(reading, words=f"a base {stands}: gravity along [{axis}] of the file")

    def other_zeros(self, plain: Reading) -> Iterator[Reading]:
        """Yield readings with the offset of one position that fits the file's links best.

        They are those that fit nearly as well as the best one, to first order.
        """
        first = np.array([self._offset(plain, k)[1] for k in range(len(plain.order))])
        least = max(float(first.max()) - c.MAX_BEHIND, c.MAX_BEHIND)
        for k in np.flatnonzero(first > least).tolist():
            offset = np.zeros(len(plain.order))
            for _ in range(c.READING_ROUNDS):
                offset[k] += self._offset(replace(plain, offset=offset.copy()), k)[0]
            offset = np.radians(np.round(np.degrees(offset)))
            words = f"an offset of q_{k + 1} by {round(np.degrees(offset[k]))} degrees"
            write = f"position_offset: {explained.entries(offset)}"
            yield replace(plain, words=words, write=write, offset=offset)

    def _offset(self, reading: Reading, k: int) -> tuple[float, float]:
        """Return a further offset of position k [rad], and the score of it, to first order."""
        near = replace(reading, offset=reading.offset + _LITTLE * (reading.order == k))
        now, moved = (
            np.stack([y - Y @ self.file for Y, y in self._without_friction(one)])
            for one in (reading, near)
        )
        slope, size = (moved - now) / _LITTLE, np.maximum(np.sum(now**2, axis=1), 1e-300)
        fall, bend = (np.sum(slope * x, axis=1) / size for x in (now, slope))
        step = -float(fall.sum() / max(bend.sum(), 1e-300))
        left = np.sum((now + step * slope) ** 2, axis=1) / size
        return step, -float(np.log(np.maximum(left, 1e-300)).sum())

    def _without_friction(self, reading: Reading) -> list[tuple[Array, Array]]:
        """Return the columns of the rigid parameters and the torque of each joint.

        The part that the joint's friction can explain is removed from both by projection. Shapes
        (M, 11 n) and (M,); 0 where the joint rests.
        """
        order, places = reading.order, reading.places
        q, v, vd = (x[:, places] for x in self.motion)
        q, v, vd = reading.turned * q + reading.offset, reading.turned * v, reading.turned * vd
        is_plain = (
            np.array_equal(places, np.arange(len(places)))
            and np.all(reading.turned == 1)
            and not reading.offset.any()
            and reading.gravity is self.plain.gravity
        )
        Y = self.columns if is_plain else rigid_columns(self.robot, q, v, vd, reading.gravity)
        tau, counts = reading.sign * self.tau[:, order], self.moves[:, order]
        counts = counts & self.moves[:, places]
        speed, made = explained.over_largest(self.robot.gear_speed(v)), []
        for k in range(len(order)):
            used = counts[:, k, None].astype(float)
            known = explained.like_friction(speed[:, k], c.FRICTION_WIDTHS)
            if self.file[-len(order) + k] == 0:  # a rotor that the file lacks
                known = np.column_stack([known, Y[:, k, -len(order) + k]])
            known = explained.basis(used * known)
            both = explained.without(known, used * np.column_stack([Y[:, k], tau[:, k]]))
            made.append((both[:, :-1], both[:, -1]))
        return made
