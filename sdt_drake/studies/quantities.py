"""What the outcomes of a run are called and measured in: the one place for titles and units."""

from __future__ import annotations

import math
import re
from typing import NamedTuple


class Quantity(NamedTuple):
    """How a number of the table is shown.

    Attributes:
        title: in words.
        unit: of the numbers shown; "" for one that nothing is known of.
        factor: from the unit of the table to the one shown.
    """

    title: str
    unit: str
    factor: float

    @property
    def label(self) -> str:
        """Title and unit, for an axis or the head of a table."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


FAMILIES: dict[str, Quantity] = {
    "max_abs_speed_error": Quantity("largest speed error", "rad/s", 1),
    "rms_speed_error": Quantity("RMS speed error", "rad/s", 1),
    "constant_speed_error": Quantity("speed error at constant speed", "rad/s", 1),
    "max_abs_position_error": Quantity("largest position error", "deg", math.degrees(1)),
    "saturated_fraction": Quantity("saturation", "% of time", 100),
    "rms_torque_share": Quantity("RMS torque", "% of the motor", 100),
    "peak_torque_share": Quantity("peak torque", "% of the motor", 100),
    "used_torque_share": Quantity("torque used", "% of the motor", 100),
    "rated_torque_share": Quantity("RMS torque", "% of rated", 100),
    "winding_temperature": Quantity("winding temperature", "% of rated", 100),
    "torque_at_speed_share": Quantity("torque at speed", "% of the envelope", 100),
    "stretch": Quantity("stretch of the motion", "% of its time", 100),
    "felt_share": Quantity("error that can be felt", "% of time", 100),
}
"""By the name before `_k` for joint k; less is better for each of them. Joint side, torques as
shares of the motor's largest."""


def family_of(name: str) -> tuple[str, int | None]:
    """The family of an outcome and its joint (1..n): ("rms_speed_error", 2); None for no joint.

    Only the families of FAMILIES have joints; another name is a family of its own.
    """
    match = re.fullmatch(r"(.+)_([1-9]\d*)", name)
    if match and match[1] in FAMILIES:
        return match[1], int(match[2])
    return name, None


def quantity_of(name: str) -> Quantity:
    """How an outcome or its family is shown; one that is not known, by its name and as it is."""
    return FAMILIES.get(family_of(name)[0], Quantity(name, "", 1))
