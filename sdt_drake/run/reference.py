"""The reference of a loop: planned or learned, on a clock that it shares with the drives."""

import copy
import math
from dataclasses import dataclass, replace

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import within
from sdt_drake.motion import LearnedReference, Motion, load_learned
from sdt_drake.robot.device import Drive
from sdt_drake.robot.motors import as_driven
from sdt_drake.robot.robot import Robot
from sdt_drake.run.scenario import Scenario

_PERIOD_BITS = 31
"""Bits of a rounded period: 2^22 multiples are exact, and the relative rounding is below 5e-10."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The reference of a loop: three motions of the joints, and a learned torque."""

    planned: Motion
    """Planned motion. Errors are measured against it."""
    tracked: Motion
    """Motion that the controller tracks: the planned or the learned one."""
    held: Motion
    """Tracked motion as the loop holds it: with the held speeds, on the loop's clock."""
    torque: Array | None
    """Learned torque, added to the feedforward; motor side [N m], shape (N + 1, n)."""


def reference_of(
    scenario: Scenario, nominal: Robot, planned: Motion, learned: LearnedReference | None
) -> Reference:
    """Return the reference of a scenario for a planned motion.

    Args:
        scenario: gives held speed, drive, torque margin, and by default a learned reference.
        nominal: the robot that the motion was planned for.
        planned: the planned motion.
        learned: a learned reference that replaces that of the scenario.

    Raises:
        InputError: if it was learned from another motion, or exceeds a limit.
    """
    robot, margin = as_driven(nominal, scenario.drive), scenario.torque_margin
    if learned is not None:
        learned.check(planned, robot, torque_margin=margin)
    elif scenario.learned:
        with within(place="learned"):
            learned = load_learned(scenario.learned, planned, robot, torque_margin=margin)
    else:
        learned = LearnedReference(planned)
    held = held_reference(scenario, learned.motion)
    return Reference(planned, learned.motion, held, learned.torque)


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
