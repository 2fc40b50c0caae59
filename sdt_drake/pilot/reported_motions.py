"""Motions of the head in published experiments, and what the observer predicts of them.

Reports and sources are in reported.yaml; `sdt_drake.pilot.reported` compares the two.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.orientation import MAX_PERIOD, Percept

_PERIOD = 0.02
"""Sample period of a motion that changes [s]; a steady one has the longest that is accepted."""

_ARM, _LONG_ARM = 7.25, 9.1
"""Arm lengths of centrifuges [m]. 9.1 m is published for the study of 2013 and assumed for the
slower rise; 7.25 m is assumed for the others."""

_LIGHT_AIRCRAFT, _JET = 80.0, 150.0
"""Speeds of the aircraft [m/s], assumed: no report tells them."""

_PLATEAU = 120.0
"""Simulated part of plateaus of 5 and 6 min [s]; no prediction changes by 0.7 deg after it."""

Feel = Callable[[Array, Array, Array], Percept]
Numbers = Iterator[tuple[str, float]]
"""Ids of reported.yaml with the predictions of a parameter set for one motion."""


@dataclass(frozen=True, eq=False)
class Head:
    """A motion of the head in its axes: x forward, y left, z up."""

    time: Array
    """Time of the samples [s], shape (N,)."""
    force: Array
    """Specific force [m/s²], shape (N, 3)."""
    rate: Array
    """Angular rate [rad/s], shape (N, 3)."""

    def seen_from(self, axes: Array) -> "Head":
        """Return the motion in other axes, whose unit vectors are the rows of `axes`, (3, 3)."""
        return Head(self.time, self.force @ axes.T, self.rate @ axes.T)

    def felt_by(self, feel: Feel) -> Percept:
        """Return the percept of the motion."""
        return feel(self.time, self.force, self.rate)


_BACKWARD = np.diag([-1.0, -1, 1])
_SUPINE = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
"""Axes of a head that faces backward, and of one that lies supine with the feet forward."""


def _yaw(feel: Feel) -> Numbers:
    head = _upright(1, 120, 1, 120)
    head.rate[:, 2] = np.radians(np.interp(head.time, [0, 1, 121, 122], [0, 60, 60, 0]))
    felt = head.felt_by(feel)
    yield "yaw_start", _fading(felt.time, felt.rate[:, 2], 1, 121)
    yield "yaw_stop", _fading(felt.time, felt.rate[:, 2], 122)


def _forward(feel: Feel) -> Numbers:
    head = _upright(1, 59)
    head.force[1:, 0] = 0.3 * GRAVITY
    yield "forward", float(np.degrees(head.felt_by(feel).pitch[-1]))


def _turn_156(feel: Feel) -> Numbers:
    felt = _gondola(50, rise=7, hold=_PLATEAU).felt_by(feel)
    yield "turn_1.56_start", _inwards(felt, 7)
    yield "turn_1.56_end", _inwards(felt, np.inf)


def _turn_2(feel: Feel) -> Numbers:
    felt = _gondola(60, rise=10, hold=_PLATEAU).felt_by(feel)
    for people in ("non_pilots", "fighter", "helicopter", "pilots"):
        yield f"turn_2_{people}", _inwards(felt, 10)
    yield "turn_2_pilots_end", _inwards(felt, np.inf)
    head = _gondola(60, rise=10, hold=0)
    felt = head.seen_from(_BACKWARD).felt_by(feel)
    for people in ("non_pilots", "fighter", "helicopter"):
        yield f"turn_2_{people}_backward", -_inwards(felt, 10)


def _turn_2_long_arm(feel: Feel) -> Numbers:
    felt = _gondola(60, rise=10, hold=_PLATEAU, arm=_LONG_ARM).felt_by(feel)
    for people in ("non_pilots", "students"):
        yield f"turn_9.1m_{people}", _inwards(felt, 10)
        yield f"turn_9.1m_{people}_end", _inwards(felt, np.inf)


def _turn_slower(feel: Feel) -> Numbers:
    head = _gondola(60, rise=12.5, hold=_PLATEAU, arm=_LONG_ARM)
    felt = head.felt_by(feel)
    yield "turn_slower", _inwards(felt, 12.5)
    yield "turn_slower_fading", _fading(felt.time, felt.roll, 12.5)
    rising = _gondola(60, rise=12.5, hold=0, arm=_LONG_ARM)
    down = rising.seen_from(_SUPINE).felt_by(feel).gravity[-1]
    yield "turn_slower_supine", float(np.degrees(np.arctan2(down[1], -down[0])))


def _aircraft(feel: Feel) -> Numbers:
    felt = _aircraft_turn(45, rise=15, hold=_PLATEAU, speed=_LIGHT_AIRCRAFT).felt_by(feel)
    yield "aircraft_1.4", _inwards(felt, 15)
    yield "aircraft_1.4_end", _inwards(felt, np.inf)
    felt = _aircraft_turn(60, rise=10, hold=_PLATEAU, speed=_JET).felt_by(feel)
    yield "aircraft_2", _inwards(felt, 10)
    yield "aircraft_2_end", _inwards(felt, np.inf)


def _hyper_g(feel: Feel) -> Numbers:
    def felt_roll(g: float, time: Array, roll: Array) -> Array:
        head = Head(time, np.zeros((len(time), 3)), np.zeros((len(time), 3)))
        head.force[:, 1], head.force[:, 2] = np.sin(roll), np.cos(roll)
        head.rate[:, 0] = np.gradient(roll, time)
        return Head(time, g * GRAVITY * head.force, head.rate).felt_by(feel).roll

    time = _times(10, 30)
    rising = 0.125 * np.clip(time - 2, 0, 8)
    tilt = np.radians(20) * (rising - np.sin(2 * np.pi * rising) / (2 * np.pi))
    late = time > 38
    for g in (1.5, 2.0):
        yield f"tilt_{g:g}", float((felt_roll(g, time, tilt)[late] / tilt[late]).mean())
    time = _times(0, 80)
    swing = np.radians(10) * np.sin(2 * np.pi * 0.0625 * time)
    late = time >= 32  # three whole periods; the first two settle
    yield "tilting_2", float(np.polyfit(swing[late], felt_roll(2, time, swing)[late], 1)[0])


def _coriolis(feel: Feel) -> Numbers:
    head = _upright(9, 59, 1.5, 0)
    time = head.time
    spin = np.radians(np.interp(time, [0, 9], [0, 90]))
    roll = np.radians(np.interp(time, [68, 69.5], [0, 30]))
    head.rate[:, 0] = np.where(time > 68, np.radians(30 / 1.5), 0)
    head.rate[:, 1], head.rate[:, 2] = spin * np.sin(roll), spin * np.cos(roll)
    head.force[:, 1], head.force[:, 2] = GRAVITY * np.sin(roll), GRAVITY * np.cos(roll)
    yield "coriolis", float(abs(np.degrees(head.felt_by(feel).rate[-1, 1])))


MOTIONS = (
    _yaw, _forward, _turn_156, _turn_2, _turn_2_long_arm, _turn_slower, _aircraft, _hyper_g,
    _coriolis,
)  # fmt: skip
"""Functions that yield the predicted quantities of a motion."""


def _times(*stretches: float) -> Array:
    """Return sample times of stretches [s] that change and are steady, by turns."""
    time = np.zeros(1)
    for k, length in enumerate(stretches):
        count = round(length / (MAX_PERIOD if k % 2 else _PERIOD))
        time = np.concatenate([time, time[-1] + np.linspace(0, length, count + 1)[1:]])
    return time


def _upright(*stretches: float) -> Head:
    """Return a head that is upright and at rest, at the times of `_times`."""
    time = _times(*stretches)
    force, rate = np.zeros((2, len(time), 3))
    force[:, 2] = GRAVITY
    return Head(time, force, rate)


def _gondola(angle_deg: float, rise: float, hold: float, arm: float = _ARM) -> Head:
    """Return the head motion of a left turn in a gondola on an arm [m], facing forward.

    The gondola rolls along the resultant of gravity and centripetal force, to `angle_deg`; the
    tangential force stays along x. The arm accelerates uniformly for `rise` [s], then turns
    uniformly for `hold` [s].
    """
    head = _upright(rise, hold)
    largest = np.sqrt(GRAVITY * np.tan(np.radians(angle_deg)) / arm)
    rising, omega = head.time < rise, largest * np.minimum(head.time / rise, 1)
    tangent = omega**2 * arm / GRAVITY
    angle, rate_of_tangent = np.arctan(tangent), 2 * omega * largest / rise * arm / GRAVITY
    head.rate[:, 0] = np.where(rising, -rate_of_tangent / (1 + tangent**2), 0)
    head.rate[:, 1], head.rate[:, 2] = -omega * np.sin(angle), omega * np.cos(angle)
    head.force[:, 0] = np.where(rising, largest / rise * arm, 0)
    head.force[:, 2] = GRAVITY / np.cos(angle)
    return head


def _aircraft_turn(bank_deg: float, rise: float, hold: float, speed: float) -> Head:
    """Return the head motion of a level coordinated left turn of an aircraft.

    Its bank rises uniformly within `rise` [s] to `bank_deg`, then stays for `hold` [s]. At a bank
    phi it turns at g tan(phi) / speed [rad/s], and the force is g / cos(phi) along z.
    """
    head = _upright(rise, hold)
    bank = np.radians(bank_deg) * np.minimum(head.time / rise, 1)
    turn = GRAVITY * np.tan(bank) / speed
    rolls = (head.time > 0) & (head.time < rise)  # not in the first sample, which had long lasted
    head.rate[:, 0] = np.where(rolls, -np.radians(bank_deg) / rise, 0)
    head.rate[:, 1], head.rate[:, 2] = -turn * np.sin(bank), turn * np.cos(bank)
    head.force[:, 2] = GRAVITY / np.cos(bank)
    return head


def _inwards(felt: Percept, at: float) -> float:
    """Return the felt roll to the left at a time [deg]; after the end, the last one."""
    return -float(np.degrees(np.interp(at, felt.time, felt.roll)))


def _fading(time: Array, values: Array, start: float, end: float = np.inf) -> float:
    """Return the time from `start` until values first fall to 37 % [s]; NaN if they do not."""
    since = (time >= start - 1e-9) & (time <= end)
    time, left = time[since], np.abs(values[since] / values[since][0])
    if left.min() > 0.37:
        return np.nan
    k = int((left <= 0.37).argmax())
    return float(np.interp(-0.37, -left[k - 1 : k + 1], time[k - 1 : k + 1])) - start
