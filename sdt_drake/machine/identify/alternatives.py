"""What else columns of a recording could mean, and whether that explains the torques better.

An alternative has one name: two torques swapped, columns from the tip to the base, a sign, a zero
that is off by a right angle, another direction of gravity. Each is judged twice, with the friction
of every joint free: by any links, which the motion alone ties to each other, and by the links of
the file. The score of an alternative is the logarithm of the ratio of what is left (RMS), summed
over the joints, for both. Blocks of time tell how sure it is.
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

_ROWS = 400  # that are compared
_FLOOR = 0.03  # of a torque: less is explained by nothing that has a name
_ODD = 0.5  # of a torque left by the file's links: where all leave less, nothing is tried
_BETTER, _BY_ANY, _BY_FILE = 2.0, 0.5, 4.0  # scores; see `Better`
_AS_GOOD = 0.5  # less of a score: told as well
_BLOCKS, _SURE = 10, 3.0  # of time; standard errors
_TILTED = 3.0  # degrees, from where on gravity has another direction
_ROUNDS = 3
_WIDTHS = (0.02, 0.1)  # of the largest speed, over which friction changes its sign
_RIGHT = np.pi / 2


@dataclass(frozen=True, eq=False)
class Reading:
    """How columns are read.

    Attributes:
        words: what they are then, as the end of "are explained by ...".
        write: what a mapping file would say; "" where none can.
        order: whose torques the columns are, shape (n,).
        whole: whether positions are in that order, too.
        turned: 1, or -1 for a joint whose position counts the other way, shape (n,).
        sign: 1, or -1 for a torque that does, shape (n,).
        offset: added to positions [rad], shape (n,).
        gravity: in the world [m/s²], shape (3,).
    """

    words: str
    write: str
    order: Index
    whole: bool
    turned: Array
    sign: Array
    offset: Array
    gravity: Array


class Left(NamedTuple):
    """What is left of torques: squares in each row over those of what is no friction, shape (M, n);
    and the parameters of the links that leave it, shape (11 n,).

    Attributes:
        free: by any links.
        file: by those of the file.
        links: that leave `free`.
    """

    free: Array
    file: Array
    links: Array


class Better(NamedTuple):
    """An alternative that explains torques better.

    It has a score of _BETTER by any links and those of the file together; of _BY_ANY by any links,
    or, as a file may be wrong where the motion alone decides nothing, of _BY_FILE by the file's.

    Attributes:
        reading: what the columns are.
        score: see above.
        before, after: RMS of what the file's links leave of each torque [-], shape (n,).
        any_before, any_after: likewise, any links.
    """

    reading: Reading
    score: float
    before: Array
    after: Array
    any_before: Array
    any_after: Array


def better_readings(
    robot: Robot, eq: Equations, factor: Array, *, by_file: bool = True
) -> list[Better]:
    """Alternatives that explain the torques better than the mapping does, the best first: those
    that explain them as well as the best one; none where the mapping is not to blame.

    Args:
        robot: of the file.
        eq: the equations.
        factor: of each torque, to the unit that it is in, shape (n,).
        by_file: whether the links of the file may decide, too.
    """
    plain = _as_read(robot)
    judge = _Judge(robot, _Rows.of(eq, factor), plain.gravity)
    now = judge.left(plain)
    if np.all(_rms(now.file) < _ODD):
        return []
    found = []
    for reading in (*_alternatives(plain), judge.other_gravity(plain)):
        if reading is None:
            continue
        left = judge.left(reading)
        of_any, of_file = _score(now.free, left.free), _score(now.file, left.file)
        both = of_any + of_file
        score, error = both.mean(), both.std(ddof=1) / np.sqrt(_BLOCKS)
        decides = of_any.mean() > _BY_ANY or (
            by_file and of_any.mean() > -_BY_ANY and of_file.mean() > _BY_FILE
        )
        if score > max(_BETTER, _SURE * error) and decides and of_file.mean() > 0:
            sizes = map(_rms, (now.file, left.file, now.free, left.free))
            found.append(Better(reading, float(score), *sizes))
    found.sort(key=lambda one: -one.score)
    return [one for one in found if one.score > found[0].score - _AS_GOOD]


def _score(before: Array, after: Array) -> Array:
    """In each block of time, shape (_BLOCKS,)."""
    blocks = np.array_split(np.arange(len(before)), _BLOCKS)
    ratio = [before[b].mean(axis=0) / after[b].mean(axis=0) for b in blocks]
    return 0.5 * np.log(ratio).sum(axis=1)


def _rms(left: Array) -> Array:
    """Over all rows, shape (n,)."""
    return np.asarray(np.sqrt(left.mean(axis=0)))


@dataclass(frozen=True, eq=False)
class _Rows:
    """Some rows of equations.

    Attributes:
        q, v, vd, tau: as of `Equations`, shape (M, n).
        moves: which count, shape (M, n).
    """

    q: Array
    v: Array
    vd: Array
    tau: Array
    moves: Mask

    @staticmethod
    def of(eq: Equations, factor: Array) -> _Rows:
        """About _ROWS of those for fitting, evenly; torques times a factor, shape (n,)."""
        fit = np.flatnonzero(eq.fit & eq.moves.any(axis=1))
        few = fit[np.unique(np.linspace(0, len(fit) - 1, min(len(fit), _ROWS)).astype(int))]
        return _Rows(*(x[few] for x in (eq.q, eq.v, eq.vd, eq.tau * factor, eq.moves)))


def _as_read(robot: Robot) -> Reading:
    """The columns as the mapping has them."""
    ones = np.ones(robot.n)
    gravity = Bodies.of(robot).gravity
    order = np.arange(robot.n)
    return Reading("", "", order, False, ones, ones, 0 * ones, gravity)


def _alternatives(plain: Reading) -> Iterator[Reading]:
    """All that are tried but for gravity."""
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
        told = _list(sign)
        yield replace(plain, words=f"tau_{k + 1} of the other sign",
                      write=f"torque_factor: {told}", sign=sign)  # fmt: skip
        yield replace(plain, words=f"q_{k + 1} of the other sign",
                      write=f"direction: {told}, torque_factor: {told}", turned=sign)  # fmt: skip
        words = f"joint {k + 1} counted the other way"
        yield replace(plain, words=words, write=f"direction: {told}", turned=sign, sign=sign)
        for turn in (_RIGHT, -_RIGHT, 2 * _RIGHT):
            offset = other(k, turn, 0.0)
            degrees = round(np.degrees(turn))
            yield replace(plain, words=f"a zero of q_{k + 1} that is off by {degrees} degrees",
                          write=f"position_offset: {_list(offset)}", offset=offset)  # fmt: skip


def _list(values: Array | Index) -> str:
    return f"[{', '.join(f'{x:.5g}' for x in values)}]"


class _Judge:
    """What is left of the torques by each way of reading the columns."""

    def __init__(self, robot: Robot, rows: _Rows, gravity: Array):
        self.robot, self.rows, self.gravity = robot, rows, gravity
        self.file = rigid_parameters(robot)
        self.scale = rigid_scale(robot)
        self.columns = rigid_columns(robot, rows.q, rows.v, rows.vd)  # as the mapping has them

    def left(self, reading: Reading) -> Left:
        """What is left by a reading."""
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
        """The direction of gravity that the torques tell, if it is not that of the file: of its
        links first, then of any. To all links torques are linear in gravity."""
        size = float(np.linalg.norm(plain.gravity))
        if size == 0:
            return None
        reading, links = plain, self.file
        for _ in range(_ROUNDS):
            unit = (*np.eye(3), np.zeros(3))
            told = [self._without_friction(replace(plain, gravity=x)) for x in unit]
            A, b = np.zeros((3, 3)), np.zeros(3)
            for k, (Y0, y) in enumerate(told[3]):
                X = np.column_stack([told[i][k][0] @ links - Y0 @ links for i in range(3)])
                off = y - Y0 @ links
                weight = 1 / max(float(np.mean(y**2)), 1e-300)
                A, b = A + weight * X.T @ X, b + weight * X.T @ off
            along = np.asarray(np.linalg.lstsq(A, b, rcond=1e-9)[0])
            along = along * size / max(float(np.linalg.norm(along)), 1e-300)
            reading = replace(plain, gravity=along)
            links = self.left(reading).links
        cosine = float(reading.gravity @ plain.gravity) / size**2
        angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
        if angle < _TILTED:
            return None
        stands = "upside down, as on a ceiling" if angle > 165 else f"turned by {angle:.0f} degrees"
        stands += ", as on a wall" * (75 < angle < 105)
        told_as = ", ".join(f"{x + 0.0:.2f}" for x in np.round(reading.gravity / size, 2))
        return replace(reading, words=f"a base {stands}: gravity along [{told_as}] of the file")

    def _without_friction(self, reading: Reading) -> list[tuple[Array, Array]]:
        """Columns of the rigid parameters and torque of each joint, what any friction of it
        explains taken out of both, shapes (M, 11 n) and (M,); 0 where the joint rests."""
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
        made = []
        for k in range(len(order)):
            x = v[:, k] / max(float(np.abs(v[:, k]).max()), 1e-12)
            own = np.column_stack([np.ones_like(x), x, *(np.tanh(x / w) for w in _WIDTHS)])
            both = counts[:, k, None] * np.column_stack([Y[:, k], tau[:, k]])
            Q, _ = np.linalg.qr(counts[:, k, None] * own)
            both = both - Q @ (Q.T @ both)
            made.append((both[:, :-1], both[:, -1]))
        return made
