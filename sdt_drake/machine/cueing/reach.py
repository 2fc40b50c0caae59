"""The most that a device can reach of a flight, told before any search."""

from dataclasses import dataclass

import numpy as np

from sdt_drake.machine.cueing.flight import Flight
from sdt_drake.machine.cueing.problem import SPEED_SHARE, has_arm
from sdt_drake.pilot.head import head_motion
from sdt_drake.robot.robot import Robot

_POSTURES = 20000
_CONE = 0.96  # cosine of the angle between the forces of device and flight


@dataclass(frozen=True)
class Reach:
    """The largest sustained resultant of a device beside that of a flight."""

    device: str
    """Name of the device."""
    g: float
    """Largest resultant at constant speeds in the direction of the largest one in flight [G]."""
    flown: float
    """Largest resultant in flight [G]."""
    beyond: float
    """Time in flight with more than the device reaches [s]."""
    duration: float
    """Duration of the flight [s]."""

    def __str__(self) -> str:
        most = f"reaches at most about {self.g:.1f} G"
        most = most if np.isfinite(self.g) else "has no limits of speed"
        text = f"{self.device} {most}; the flight has up to"
        more = f", and more than the device for {self.beyond:.3g} of {self.duration:.3g} s"
        return f"{text} {self.flown:.1f} G{more if self.beyond else ''}"


def reach(robot: Robot, flight: Flight) -> Reach:
    """Return what a device reaches of a flight, in the direction of the flight's largest force.

    The arm turns at top speed; a device without an arm moves all joints.
    """
    rng, n = np.random.default_rng(0), robot.n
    lower, upper = np.maximum(robot.position_lower, -np.pi), np.minimum(robot.position_upper, np.pi)
    q = rng.uniform(np.minimum(lower, upper), np.maximum(lower, upper), (_POSTURES, n))
    sides = rng.choice([-1.0, 1.0], q.shape)
    if has_arm(robot):
        sides = np.eye(n)[np.zeros(_POSTURES, dtype=int)]
    size, speed = flight.resultant_g, SPEED_SHARE * robot.top_speed
    if not np.isfinite(speed[sides.any(axis=0)]).all():
        return Reach(robot.name, np.inf, float(size.max()), 0.0, flight.duration)
    v = sides * np.where(sides.any(axis=0), speed, 0.0)
    head, peak = head_motion(robot, q, v, 0 * q), flight.specific_force[size.argmax()]
    along = head.specific_force @ peak / np.linalg.norm(peak)
    aligned = along > _CONE * np.linalg.norm(head.specific_force, axis=1)
    most = float(head.resultant_g[aligned if aligned.any() else ...].max())
    beyond = float(np.trapezoid((size > most).astype(float), flight.time))
    return Reach(robot.name, most, float(size.max()), beyond, flight.duration)
