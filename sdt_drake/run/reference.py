"""The reference of a loop: planned or learned, on a clock that it shares with the drives."""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import numpy as np

from sdt_drake.io.errors import within
from sdt_drake.motion import LearnedReference, Motion, load_learned
from sdt_drake.robot.device import Drive
from sdt_drake.robot.motors import as_driven
from sdt_drake.robot.robot import Robot
from sdt_drake.run.scenario import Scenario

_PERIOD_BITS = 31
"""Bits of a rounded period: 2^22 multiples are exact, and the relative rounding is below 5e-10."""


def taught_reference(
    scenario: Scenario, nominal: Robot, wanted: Motion, given: LearnedReference | None
) -> LearnedReference:
    """Return the given learned reference, that of the scenario's file, or the planned motion.

    Raises:
        InputError: if it was learned from another motion, or exceeds a limit.
    """
    robot, margin = as_driven(nominal, scenario.drive), scenario.torque_margin
    if given is not None:
        given.check(wanted, robot, torque_margin=margin)
        return given
    if not scenario.learned:
        return LearnedReference(wanted)
    with within(place="learned"):
        return load_learned(scenario.learned, wanted, robot, torque_margin=margin)


def held_reference(scenario: Scenario, motion: Motion) -> Motion:
    """Return the motion that the loop holds: with the scenario's held speeds, on the loop's clock.

    Updates at the same instant do not see each other, but an update one bit later does. Instants of
    drives and reference must therefore agree to the last bit. So if the drives sample several times
    per interpolation period, the drive period is rounded to few bits, which makes all multiples of
    both periods exact. The period changes by less than 1e-9 of itself.
    """
    if scenario.held_speed == "mean":
        mean = np.diff(motion.q, axis=0) / motion.period
        motion = replace(motion, v=np.vstack([mean, motion.v[-1:]]))
    samples = _samples(scenario.drive, motion)
    if samples == 1:
        return motion
    mantissa, exponent = math.frexp(motion.period / samples)
    exact = math.ldexp(round(math.ldexp(mantissa, _PERIOD_BITS)), exponent - _PERIOD_BITS)
    return replace(motion, period=samples * exact)


def drive_on_clock(drive: Drive, reference: Motion) -> Drive:
    """Return a drive with its period on the clock of a held reference, and with its true delay.

    A drive that samples takes a reference at its first sample after the arrival.
    """
    if drive.period is None:
        return drive
    period = reference.period / _samples(drive, reference)
    delay = math.ceil(drive.reference_delay / period - 1e-6) * period
    made = copy.copy(drive)  # unchecked: rounding may leave the allowed range
    vars(made).update(period=period, reference_delay=delay)
    return made


def _samples(drive: Drive, motion: Motion) -> int:
    """Return the number of drive samples per interpolation period."""
    return 1 if drive.period is None else round(motion.period / drive.period)
