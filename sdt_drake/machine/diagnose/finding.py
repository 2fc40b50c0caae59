"""Finding: something that a recording shows, with its evidence in numbers and in a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

KINDS = {
    # the recording alone
    "uneven": "steps of time differ",
    "rounded": "times were rounded, or taken on writing",
    "missing": "samples are missing",
    "held": "each value is repeated for several samples",
    "repeated": "some samples repeat the one before",
    "frozen": "a signal stands for a while",
    "clipped": "a torque is cut off",
    "degrees": "positions are in degrees",
    "clock": "a second of the clock is none",
    "speeds": "a speed is not the derivative of its position",
    "late speeds": "speeds lag behind positions",
    "at limit": "a motor is at its limit",
    "beyond limit": "a torque is far beyond the limit of its motor",
    # its columns and units, by the robot's links
    "unit": "torques, or quantities of a flight, have another unit",
    "columns": "columns, or axes of a flight, have another order, sign, zero or direction",
    # what a fit leaves
    "still": "a joint stands still",
    "driving": "friction drives instead of braking",
    "late torques": "torques lag behind positions",
    "residual": "rigid links and friction do not explain a torque, and something does",
    "held out": "held-out data are explained far worse than fitted data",
    "inconsistent": "links that can exist explain a torque worse than free parameters",
    "excitation": "the motion hardly excites some parameters",
    # what a simulation of it leaves
    "scenario": "a simulation with one change explains a recording better",
    "controller": "the controller commands another torque than the recorded one",
    # repeated trials of one motion
    "noise": "the error that repeats is below the noise",
    "converged": "the last trial hardly reduced the error",
    "limited": "a limit shortens the step to the next trial",
    "assumed": "the reference was not recorded, so one is assumed",
    # how the file was read
    "reading": "a part of the file was left out or changed",
}
"""Kinds of findings with their meanings."""

SPOILING = {"rounded", "repeated", "frozen", "clipped", "degrees", "clock"}
"""Kinds that must be corrected before other conclusions."""


@dataclass(frozen=True)
class Finding:
    """Something that a recording shows; `str` gives it in words."""

    kind: str
    """One of `KINDS`."""
    sentence: str
    """The finding as a sentence without its end."""
    joints: tuple[int, ...] = ()
    """The joints that show it, from 1; empty for the whole recording."""
    evidence: Mapping[str, float] = field(default_factory=dict)
    """Numbers by name [SI units in the name, else -], as the sentence tells them."""
    remedy: str = ""
    """The remedy as an entry of the mapping file; "" if there is none."""
    source: str = ""
    """Name of the recording's file; "" for a finding from several."""

    @property
    def spoils(self) -> bool:
        """True if the recording must be corrected before other conclusions."""
        return self.kind in SPOILING

    def __str__(self) -> str:
        text = f"{self.source}: {self.sentence}" if self.source else self.sentence
        return f"{text} ({self.remedy} in the mapping file)" if self.remedy else text
