"""Likely unit and side of a recording's positions, by limits and by the torques of the links.

Each other meaning is tried: the limits of the robot must allow its motion. The torques that the
file's links need for it are compared with the recorded ones, with any friction. What is left of a
torque is measured twice, as it is and with any factor, for its unit may be wrong, too.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from sdt_drake.io.arrays import Array, Mask
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose import explained
from sdt_drake.machine.recordings.columns import ANGLE_UNITS, Columns
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot

_IN = {"deg": "in degrees", "rad": "in radians", "turn": "in turns"}


class Meaning(NamedTuple):
    """A meaning of positions."""

    words: str
    """The end of the question "are its positions ...?"."""
    changes: dict[str, str]
    """Fields of the mapping that differ."""
    q: Array
    """Positions with this meaning [rad], shape (N, n)."""


def other_meanings(robot: Robot, recorded: Recorded) -> list[Meaning]:
    """Return the likely meanings of positions other than the mapping's, degrees first.

    Without a motion beyond the limits of the robot, another meaning must explain the torques far
    better. Those that explain them nearly as well as the best one are as likely.
    """
    q = recorded.signals["q"]
    allowed = [x for x in _others(robot, recorded) if not beyond(robot, recorded, x.q).any()]
    is_beyond = bool(beyond(robot, recorded, q).any())
    if "tau" not in recorded.signals:
        return allowed if is_beyond else []
    left = [_left(robot, recorded, x.q) for x in allowed]
    least = min(left, default=0.0)
    if not is_beyond and _left(robot, recorded, q) - least <= c.FAR_BETTER:
        return []
    return [x for own, x in zip(left, allowed, strict=True) if own < least + c.AS_GOOD]


def beyond(robot: Robot, recorded: Recorded, q: Array) -> Mask:
    """Return the mask of joints whose motion is far beyond their limits, shape (n,)."""
    usual = np.quantile(np.abs(np.gradient(q, recorded.time, axis=0)), 0.99, axis=0)
    stops = robot.position_upper - robot.position_lower  # inf without stops
    is_fast, is_wide = usual > c.BEYOND * speed_limit(robot), np.ptp(q, axis=0) > c.BEYOND * stops
    return np.asarray(is_fast | is_wide)


def speed_limit(robot: Robot) -> Array:
    """Return the speed limit of each joint [rad/s], shape (n,); assumed where the file has none."""
    return np.where(np.isinf(robot.velocity_limit), c.SPEED_LIMIT, robot.velocity_limit)


def _others(robot: Robot, recorded: Recorded) -> Iterator[Meaning]:
    """Yield the positions in the other unit, of the other side, and both."""
    columns = recorded.columns or Columns()
    offset = np.array(columns.position_offset or 0.0)
    q = recorded.signals["q"] - offset
    is_motor, now = columns.position_side == "motor", ANGLE_UNITS[columns.angle]
    units = {unit: factor / now for unit, factor in ANGLE_UNITS.items() if factor != now}
    for unit, factor in units.items():
        yield Meaning(_IN[unit], {"angle": unit}, factor * q + offset)
    if np.all(np.abs(robot.gear_ratio) == 1):
        return
    side, of_side = ("joint", "of the joints") if is_motor else ("motor", "of the motors")
    other = robot.of_motors(q) if is_motor else robot.of_joints(q)
    changes: dict[str, str] = {"position_side": side}
    yield Meaning(of_side, changes, other + offset)
    for unit, factor in units.items():
        yield Meaning(f"{of_side}, {_IN[unit]}", {"angle": unit} | changes, factor * other + offset)


def _left(robot: Robot, recorded: Recorded, q: Array) -> float:
    """Return the mean logarithm of what links and friction leave of the torques."""
    half = max(1, round(c.SPEED_WINDOW / 4 / recorded.period))
    motion = [q]
    for _ in range(2):
        slope = np.gradient(motion[-1], recorded.time, axis=0)
        motion.append(uniform_filter1d(slope, 2 * half + 1, axis=0, mode="nearest"))
    few = np.unique(np.linspace(0, len(q) - 1, c.READING_ROWS).astype(int))
    q, v, vd = (x[few] for x in motion)
    tau, links = recorded.signals["tau"][few], inverse_dynamics(robot, q, v, vd)
    speed = explained.over_largest(robot.gear_speed(v))
    left = []
    for k in range(robot.n):
        known = explained.basis(explained.like_friction(speed[:, k], c.FRICTION_WIDTHS))
        measured, file = explained.without(known, np.column_stack([tau[:, k], links[:, k]])).T
        size, own = (max(float(np.linalg.norm(x)), 1e-300) for x in (measured, file))
        alike = max(float(measured @ file) / size / own, 0.0)
        as_it_is = float(np.linalg.norm(measured - file)) / (size + own)
        parts = (as_it_is, np.sqrt(1 - min(alike, 1.0) ** 2))
        left += [np.log(x + c.RESIDUAL_FLOOR) for x in parts]
    return float(np.mean(left))
