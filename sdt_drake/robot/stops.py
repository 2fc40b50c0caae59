"""Joint stops that push back, as springs that return a part of the energy."""

from dataclasses import dataclass

import numpy as np

from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import EachJoint, Input, NotNegative, Number, Problems, field
from sdt_drake.robot.robot import Robot

RELEASE_SPEED = 0.02
"""Speed away from a stop at which its spring has fallen to its share e² [rad/s]."""

FULLY_DAMPED = 1e-5
"""Angle beyond a stop from which it is fully damped [rad]. A jump would stop the integrator."""


@dataclass(frozen=True)
class Stops(Input):
    """Stops of the coupled plant that push back, **joint side**; without them none acts.

    The robot's file has their angles. Lists have one value for each joint.
    """

    stiffness: EachJoint[NotNegative] | None = field(None, unit="N m/rad", side="joint")
    """k, stiffness of a stop; 0 for a joint whose stops do not act."""
    damping: EachJoint[NotNegative] | None = field(None, unit="N m s/rad", side="joint")
    """c, damping of a pressed stop. 0 by default."""
    restitution: Number = field(1.0, ge=0, le=1, unit="-")
    """e, speed after an impact over speed before, at any speed and inertia, without damping."""

    @property
    def is_none(self) -> bool:
        """True if no stop acts."""
        return not self.stiffness or not any(self.stiffness)

    def problems(self) -> Problems:
        if self.stiffness is None and (self.damping or self.restitution != 1):
            yield "stiffness", "missing, expected one for each joint"

    def check(self, robot: Robot) -> None:
        """Check that each joint with a stiffness has a stop in the robot's file."""
        free = np.isinf(robot.position_lower) & np.isinf(robot.position_upper)
        for k in np.flatnonzero(free & (np.array(self.stiffness or 0.0) > 0)).tolist():
            raise InputError(
                f"{(self.stiffness or ())[k]:g}, but {robot.joint(k)} has no stop in "
                f"{robot.path.name}, expected 0",
                place=f"plant.stops.stiffness[{k + 1}]",
            )
