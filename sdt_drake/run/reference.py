"""The reference of a loop: what flights have taught, and its clock, which drives share."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sdt_drake.io.errors import at
from sdt_drake.motion import LearnedReference, Motion, load_learned
from sdt_drake.robot.device import Drive
from sdt_drake.robot.motors import as_driven
from sdt_drake.robot.robot import Robot
from sdt_drake.run.scenario import Scenario

_BITS = 31  # of a period: 2^22 multiples of it are exact, and it is off by 5e-10 of itself at most


def taught_reference(
    scenario: Scenario, nominal: Robot, wanted: Motion, given: LearnedReference | None
) -> LearnedReference:
    """Return the learned reference: the given one, or that of the scenario's file; else the planned
    motion.

    Raises:
        InputError: for what was learned of another motion, or is beyond a limit.
    """
    robot, margin = as_driven(nominal, scenario.drive), scenario.torque_margin
    if given is not None:
        given.check(wanted, robot, torque_margin=margin)
        return given
    if not scenario.learned:
        return LearnedReference(wanted)
    with at("learned"):
        return load_learned(scenario.learned, wanted, robot, torque_margin=margin)


def held_reference(scenario: Scenario, motion: Motion) -> Motion:
    """Return a motion with the speeds that the scenario says, on the clock of the loop, whose
    period is that of the motion to 1e-9 of it.

    What samples at multiples of different periods has to meet, to the last bit: of two updates at
    one instant neither sees the other, and one that comes a bit later does. So where the drives
    sample several times per interpolation period, their period is rounded to so few bits that all
    multiples of both are exact.
    """
    if scenario.held_speed == "mean":
        mean = np.diff(motion.q, axis=0) / motion.period
        motion = replace(motion, v=np.vstack([mean, motion.v[-1:]]))
    samples = _samples(scenario.drive, motion)
    if samples == 1:
        return motion
    mantissa, exponent = math.frexp(motion.period / samples)
    exact = math.ldexp(round(math.ldexp(mantissa, _BITS)), exponent - _BITS)
    return replace(motion, period=samples * exact)


def drive_on_clock(drive: Drive, reference: Motion) -> Drive:
    """Return a drive with the period and the delay that belong to a held reference."""
    if drive.period is None:
        return drive
    period, delay = reference.period / _samples(drive, reference), drive.reference_delay
    if abs(delay / period - round(delay / period)) < 1e-6:
        delay = round(delay / period) * period
    return replace(drive, period=period, reference_delay=delay)


def _samples(drive: Drive, motion: Motion) -> int:
    """Number of drive samples per interpolation period."""
    return 1 if drive.period is None else round(motion.period / drive.period)
