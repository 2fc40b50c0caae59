"""Alternative meanings of a recording's columns that explain the torques better than the mapping.

An alternative is one change: two torques swapped, columns from tip to base, a sign, an offset of a
position by a right angle, or another gravity. Each is tested twice, with free friction
at every joint: with the best links, and with the links of the file. A score is the logarithm of the
ratio of the residuals (RMS, before over after), summed over the joints. The two scores are added.
The spread over blocks of time gives the standard error.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array, Index, Mask
from sdt_drake.machine.identify.base_parameters import rigid_columns, rigid_parameters
from sdt_drake.machine.identify.consistency import rigid_scale
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.machine.identify.estimation import solved
from sdt_drake.machine.identify.regressor import Bodies
from sdt_drake.robot.robot import Robot

_MAX_ROWS = 400  # compared samples
_FLOOR = 0.03  # residual that remains in any case, over the torque
_MIN_RESIDUAL = 0.5  # residual of the file's links over the torque; below it, nothing is tried
_MIN_SCORE, _MIN_FREE_SCORE, _MIN_FILE_SCORE = 2.0, 0.5, 4.0  # see `Better`
_MAX_BEHIND = 0.5  # score; readings this close to the best are reported, too
_BLOCKS, _MIN_SIGMAS = 10, 3.0  # blocks of time; standard errors of a score
_MIN_TILT = 3.0  # degrees between two directions of gravity
_ROUNDS = 3  # iterations of the weights
_WIDTHS = (0.02, 0.1)  # widths of the sign change of friction over the largest speed
_RIGHT = np.pi / 2  # rad


@dataclass(frozen=True, eq=False)
class Reading:
    """A meaning of the columns of a recording."""

    words: str
    """The end of the sentence "torques are explained by ..."."""
    write: str
    """The entry in a mapping file; "" where none can express it."""
    order: Index
    """The joints that the torque columns belong to, from 0, shape (n,)."""
    whole: bool
    """True if positions are in that order, too."""
    turned: Array
    """1, or -1 for a position with the opposite sign, shape (n,)."""
    sign: Array
    """1, or -1 for a torque with the opposite sign, shape (n,)."""
    offset: Array
    """Values added to positions [rad], shape (n,)."""
    gravity: Array
    """Gravity in the world frame [m/s²], shape (3,)."""


class Left(NamedTuple):
    """Squared residuals over the mean square of the torque without friction."""

    free: Array
    """Residuals of the best links, shape (M, n)."""
    file: Array
    """Residuals of the links of the file, shape (M, n)."""
    links: Array
    """Parameters of the best links, shape (11 n,)."""


class Better(NamedTuple):
    """An alternative that explains torques better than the mapping.

    Its total score is above _MIN_SCORE. Its score with the best links is above _MIN_FREE_SCORE, or
    its score with the links of the file is above _MIN_FILE_SCORE. The second test has the higher
    limit because a file may be wrong. Beside a unit without a name, the links of the file do not
    decide, but another order of the columns suffices that leaves as little as the unit.
    """

    reading: Reading
    """The alternative meaning of the columns."""
    score: float
    """The total score."""
    before: Array
    after: Array
    """`before` and `after`: RMS residual of the file's links over each torque [-], shape (n,)."""
    any_before: Array
    any_after: Array
    """`any_before` and `any_after`: RMS residual of the best links [-], shape (n,)."""


def better_readings(
    robot: Robot, eq: Equations, factor: Array, unnamed: Array | None = None
) -> list[Better]:
    """Return the alternatives that explain the torques better than the mapping, the best first.

    The list contains the best one and those that are nearly as good. It is empty if the mapping
    explains the torques.

    Args:
        robot: The robot of the file.
        eq: The equations of the recordings.
        factor: Factors from each torque to N m, joint side, shape (n,).
        unnamed: Factors of a unit without a name, which the alternatives replace, shape (n,). It
            has one free number per joint, an order of the columns has none.
    """
    plain = _as_read(robot)
    judge = _Judge(robot, _Rows.of(eq, factor), plain.gravity)
    now = judge.left(plain)
    if np.all(_rms(now.file) < _MIN_RESIDUAL):
        return []
    rival = None
    if unnamed is not None:
        rival = _Judge(robot, _Rows.of(eq, unnamed), plain.gravity).left(plain)
    found = []
    for reading in (*_alternatives(plain), judge.other_gravity(plain)):
        if reading is None:
            continue
        left = judge.left(reading)
        of_any, of_file = _score(now.free, left.free), _score(now.file, left.file)
        both = of_any + of_file
        score, error = both.mean(), both.std(ddof=1) / np.sqrt(_BLOCKS)
        decides = of_any.mean() > _MIN_FREE_SCORE or (
            rival is None and of_any.mean() > -_MIN_FREE_SCORE and of_file.mean() > _MIN_FILE_SCORE
        )
        is_clear = (decides and score > _MIN_SCORE) or _is_as_good(reading, left, rival)
        if is_clear and score > _MIN_SIGMAS * error and of_file.mean() > 0:
            sizes = map(_rms, (now.file, left.file, now.free, left.free))
            found.append(Better(reading, float(score), *sizes))
    found.sort(key=lambda one: -one.score)
    return [one for one in found if one.score > found[0].score - _MAX_BEHIND]


def _is_as_good(reading: Reading, left: Left, rival: Left | None) -> bool:
    """Return True for an order of the columns that leaves as little as a unit without a name."""
    if rival is None or np.array_equal(reading.order, np.arange(len(reading.order))):
        return False
    score = _score(rival.free, left.free) + _score(rival.file, left.file)
    return bool(score.mean() > -_MAX_BEHIND)


def _score(before: Array, after: Array) -> Array:
    """Return the score in each block of time, shape (_BLOCKS,)."""
    blocks = np.array_split(np.arange(len(before)), _BLOCKS)
    ratio = [before[b].mean(axis=0) / after[b].mean(axis=0) for b in blocks]
    return 0.5 * np.log(ratio).sum(axis=1)


def _rms(left: Array) -> Array:
    """Return the RMS over all rows, shape (n,)."""
    return np.asarray(np.sqrt(left.mean(axis=0)))


@dataclass(frozen=True, eq=False)
class _Rows:
    """A selection of rows of the equations; fields as in `Equations`, shape (M, n)."""

    q: Array
    v: Array
    vd: Array
    tau: Array
    moves: Mask

    @staticmethod
    def of(eq: Equations, factor: Array) -> _Rows:
        """Select up to _MAX_ROWS fitted rows, evenly; multiply torques by `factor`, shape (n,)."""
        fit = np.flatnonzero(eq.fit & eq.moves.any(axis=1))
        few = fit[np.unique(np.linspace(0, len(fit) - 1, min(len(fit), _MAX_ROWS)).astype(int))]
        return _Rows(*(x[few] for x in (eq.q, eq.v, eq.vd, eq.tau * factor, eq.moves)))


def _as_read(robot: Robot) -> Reading:
    """Return the meaning of the columns that the mapping gives."""
    ones = np.ones(robot.n)
    gravity = Bodies.of(robot).gravity
    order = np.arange(robot.n)
    return Reading("", "", order, False, ones, ones, 0 * ones, gravity)


def _alternatives(plain: Reading) -> Iterator[Reading]:
    """Yield all alternatives except other directions of gravity."""
    n = len(plain.order)
    order = np.arange(n)

    def other(k: int, value: float, usual: float) -> Array:
        return np.where(order == k, value, usual)

    for j in range(n):
        for k in range(j + 1, n):
            places = order.copy()
            places[[j, k]] = k, j
            words = f"tau_{j + 1} and tau_{k + 1} swapped"
            yield replace(plain, words=words, write=f"tau: in the order {_list(places + 1)}",
                          order=places)  # fmt: skip
    if n > 2:
        words = "columns from the tip to the base"
        yield replace(plain, words=words, write="q and tau: in the order of the joints, base to "
                      "tip", order=order[::-1], whole=True)  # fmt: skip
    for k in range(n):
        sign = other(k, -1.0, 1.0)
        signs = _list(sign)
        yield replace(plain, words=f"tau_{k + 1} with the opposite sign",
                      write=f"torque_factor: {signs}", sign=sign)  # fmt: skip
        write = f"direction: {signs}, torque_factor: {signs}"
        yield replace(plain, words=f"q_{k + 1} with the opposite sign", write=write, turned=sign)
        words = f"the opposite direction of joint {k + 1}"
        yield replace(plain, words=words, write=f"direction: {signs}", turned=sign, sign=sign)
        for turn in (_RIGHT, -_RIGHT, 2 * _RIGHT):
            offset = other(k, turn, 0.0)
            degrees = round(np.degrees(turn))
            yield replace(plain, words=f"an offset of q_{k + 1} by {degrees} degrees",
                          write=f"position_offset: {_list(offset)}", offset=offset)  # fmt: skip


def _list(values: Array | Index) -> str:
    return f"[{', '.join(f'{x:.5g}' for x in values)}]"


class _Judge:
    """A calculator of the residual torques of each alternative."""

    def __init__(self, robot: Robot, rows: _Rows, gravity: Array):
        self.robot, self.rows, self.gravity = robot, rows, gravity
        self.file = rigid_parameters(robot)
        self.scale = rigid_scale(robot)
        self.columns = rigid_columns(robot, rows.q, rows.v, rows.vd)

    def left(self, reading: Reading) -> Left:
        """Return the residuals of a reading."""
        seen = self._without_friction(reading)
        tau = self.rows.tau[:, reading.order]
        floor = (_FLOOR * tau) ** 2 + 1e-300
        size = np.array([np.mean(y**2) for _, y in seen]) + floor.mean(axis=0)
        n, free, links = len(seen), np.ones(len(seen)), self.file

        def of(phi: Array) -> Array:
            off = np.stack([y - Yk @ phi for Yk, y in seen], axis=1)
            return np.asarray((off**2 + floor.mean(axis=0)) / size)

        grams = [(Yk.T @ Yk, Yk.T @ y) for Yk, y in seen]
        for _ in range(_ROUNDS):
            H, h = np.diag(1 / self.scale**2), self.file / self.scale**2
            for k in range(n):
                weight = 1 / (free[k] * size[k])
                H, h = H + weight * grams[k][0], h + weight * grams[k][1]
            links = solved(H, h)
            free = of(links).mean(axis=0)
        return Left(of(links), of(self.file), links)

    def other_gravity(self, plain: Reading) -> Reading | None:
        """Return a reading with the direction of gravity that fits the torques best.

        The direction is fitted with the links of the file first, then with the best links. Torques
        are linear in gravity. None if gravity is zero or has the direction of the file.
        """
        size = float(np.linalg.norm(plain.gravity))
        if size == 0:
            return None
        reading, links = plain, self.file
        for _ in range(_ROUNDS):
            unit = (*np.eye(3), np.zeros(3))
            parts = [self._without_friction(replace(plain, gravity=x)) for x in unit]
            A, b = np.zeros((3, 3)), np.zeros(3)
            for k, (Y0, y) in enumerate(parts[3]):
                X = np.column_stack([parts[i][k][0] @ links - Y0 @ links for i in range(3)])
                off = y - Y0 @ links
                weight = 1 / max(float(np.mean(y**2)), 1e-300)
                A, b = A + weight * X.T @ X, b + weight * X.T @ off
            along = np.asarray(np.linalg.lstsq(A, b, rcond=1e-9)[0])
            along = along * size / max(float(np.linalg.norm(along)), 1e-300)
            reading = replace(plain, gravity=along)
            links = self.left(reading).links
        cosine = float(reading.gravity @ plain.gravity) / size**2
        angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
        if angle < _MIN_TILT:
            return None
        stands = "upside down, as on a ceiling" if angle > 165 else f"turned by {angle:.0f} degrees"
        stands += ", as on a wall" * (75 < angle < 105)
        axis = ", ".join(f"{x + 0.0:.2f}" for x in np.round(reading.gravity / size, 2))
        return replace(reading, words=f"a base {stands}: gravity along [{axis}] of the file")

    def _without_friction(self, reading: Reading) -> list[tuple[Array, Array]]:
        """Return the columns of the rigid parameters and the torque of each joint.

        The part that the joint's friction can explain is removed from both by projection. Shapes
        (M, 11 n) and (M,); 0 where the joint rests.
        """
        rows, order = self.rows, reading.order
        places = order if reading.whole else np.arange(len(order))
        q, v, vd = (x[:, places] for x in (rows.q, rows.v, rows.vd))
        q, v, vd = reading.turned * q + reading.offset, reading.turned * v, reading.turned * vd
        is_plain = (
            not reading.whole
            and np.all(reading.turned == 1)
            and not reading.offset.any()
            and reading.gravity is self.gravity
        )
        Y = self.columns if is_plain else rigid_columns(self.robot, q, v, vd, reading.gravity)
        tau, counts = reading.sign * rows.tau[:, order], rows.moves[:, order]
        counts = counts & rows.moves[:, places]
        speed, made = self.robot.gear_speed(v), []
        for k in range(len(order)):
            x = speed[:, k] / max(float(np.abs(speed[:, k]).max()), 1e-12)
            own = np.column_stack([np.ones_like(x), x, *(np.tanh(x / w) for w in _WIDTHS)])
            both = counts[:, k, None] * np.column_stack([Y[:, k], tau[:, k]])
            Q, _ = np.linalg.qr(counts[:, k, None] * own)
            both = both - Q @ (Q.T @ both)
            made.append((both[:, :-1], both[:, -1]))
        return made
