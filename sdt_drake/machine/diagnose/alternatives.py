"""Other meanings of the columns of a recording, to be tested by `readings`."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from sdt_drake.io.arrays import Array, Index, Mask
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose import explained
from sdt_drake.machine.diagnose.orders import likely_orders
from sdt_drake.machine.diagnose.units import SHARES
from sdt_drake.robot.robot import Robot

_RIGHT = np.pi / 2  # rad


@dataclass(frozen=True, eq=False)
class Reading:
    """A meaning of the columns of a recording."""

    words: str
    """The end of the sentence "torques are explained by ..."."""
    write: str
    """The entry in a mapping file; "" where none can express it."""
    order: Index
    """The torque column of each joint, from 0, shape (n,)."""
    places: Index
    """The position column of each joint, from 0, shape (n,)."""
    turned: Array
    """1, or -1 for a position with the opposite sign, shape (n,)."""
    sign: Array
    """1, -1 for a torque with the opposite sign, or a factor from its unit, shape (n,)."""
    offset: Array
    """Values added to positions [rad], shape (n,)."""
    gravity: Array
    """Gravity in the world frame [m/s²], shape (3,)."""
    kind: str = "columns"
    """Kind of its finding."""


def alternatives(plain: Reading) -> Iterator[Reading]:
    """Yield all alternatives except other directions of gravity."""
    order = plain.order
    n = len(order)
    for j, k in combinations(range(n), 2):
        places = order.copy()
        places[[j, k]] = k, j
        words, write = f"tau_{j + 1} and tau_{k + 1} swapped", explained.entries(places + 1)
        yield replace(plain, words=words, write=f"tau: in the order {write}", order=places)
    if n > 2:
        words, write = "columns from the tip to the base", "q and tau: in the order of the joints, "
        write += "base to tip"
        yield replace(plain, words=words, write=write, order=order[::-1], places=order[::-1])
    words, write = "all torques with the opposite sign", explained.entries(-np.ones(n))
    yield replace(plain, words=words, write=f"torque_factor: {write}", sign=-np.ones(n))
    words = "torques without gravity: was it compensated, or subtracted?"
    yield replace(plain, words=words, gravity=np.zeros(3))
    for k in range(n):
        sign = np.where(order == k, -1.0, 1.0)
        torque, direction = (
            f"torque_factor: {explained.entries(sign)}",
            f"direction: {explained.entries(sign)}",
        )
        words = f"tau_{k + 1} with the opposite sign"
        yield replace(plain, words=words, write=torque, sign=sign)
        words = f"q_{k + 1} with the opposite sign"
        yield replace(plain, words=words, write=f"{direction}, {torque}", turned=sign)
        words = f"the opposite direction of joint {k + 1}"
        yield replace(plain, words=words, write=direction, turned=sign, sign=sign)
        for turn in (_RIGHT, -_RIGHT, 2 * _RIGHT):
            words = f"an offset of q_{k + 1} by {round(np.degrees(turn))} degrees"
            offset = np.where(order == k, turn, 0.0)
            write = f"position_offset: {explained.entries(offset)}"
            yield replace(plain, words=words, write=write, offset=offset)


def other_orders(
    robot: Robot, motion: tuple[Array, Array, Array], tau: Array, moves: Mask, plain: Reading
) -> Iterator[Reading]:
    """Yield the likely orders of torques, of positions, and of all columns, if they are others."""
    if robot.n == 1:
        return
    torques, places, whole = likely_orders(robot, *motion, tau, moves)
    is_swap, is_reverse = (torques != plain.order).sum() <= 2, np.all(whole == plain.order[::-1])
    for what, write, order, reading in (
        ("torques", "tau", plain.order if is_swap else torques, replace(plain, order=torques)),
        ("positions", "q and v", places, replace(plain, places=places)),
        ("all columns", "q, v and tau", plain.order if is_reverse else whole,
         replace(plain, order=whole, places=whole)),
    ):  # fmt: skip
        if np.any(order != plain.order):  # others are among the alternatives
            words = f"swapped joints ({what} in another order)"
            write += f": in the order {explained.entries(order + 1)}"
            yield replace(reading, words=words, write=write)


def in_shares(limits: Array, sizes: Array, plain: Reading) -> Iterator[Reading]:
    """Yield torques in shares of the effort limits, by the size that the file's links tell.

    A rated torque is a share of the limit.
    """
    sizes = sizes * limits
    known = np.isfinite(sizes)
    if not known.any() or not np.isfinite(limits).all() or np.ptp(limits) == 0:
        return
    peak = float(np.exp(np.median(np.log(sizes[known]))))
    for name, x in SHARES.items():
        if c.PEAKS[0] < peak / x < c.PEAKS[1]:
            is_limit = abs(np.log(peak / x)) < np.log(c.SAME_UNIT) / 2
            factor = limits / (x if is_limit else peak)
            entries = explained.entries(factor, 4)
            words = f"torques in {name} of a rated torque, with a torque_factor of about {entries}"
            write = ""
            if is_limit:
                words, write = f"torques in {name} of the effort limit", f"torque_factor: {entries}"
            yield replace(plain, words=words, write=write, sign=factor, kind="unit/shares")
