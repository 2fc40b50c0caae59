"""Filters of the speed loops as data, and the systems that they make."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from sdt_drake.io.fields import EachJoint, Input, NotNegative, Number, Positive, field
from sdt_drake.systems.filters import PASS, Section, low_pass, notch

Order = Literal["first", "second"]
_Frequencies = EachJoint[NotNegative] | None


@dataclass(frozen=True)
class Filters(Input):
    """Filters of the speed loops, none by default; lists have a value per joint, 0 for none.

    They are continuous, or run at the drive period. Those of the torque act on the feedback torque,
    ahead of the feedforward.
    """

    notch_frequency: _Frequencies = field(None, unit="Hz")
    """Frequency of a notch on the torque, such as that of an elastic joint."""
    notch_depth: EachJoint[Annotated[Number, Field(ge=0, lt=1)]] | None = field(None, unit="-")
    """Gain of the notch at its frequency; 0.1 by default."""
    notch_width: EachJoint[Annotated[Positive, Field(le=10)]] | None = field(None, unit="-")
    """-3 dB width of the notch at a depth of 0, over its frequency; 1 by default."""
    torque_low_pass: _Frequencies = field(None, unit="Hz")
    """-3 dB frequency of a low pass on the torque."""
    torque_order: Order = "second"
    """Order of the low pass on the torque."""
    speed_low_pass: _Frequencies = field(None, unit="Hz")
    """-3 dB frequency of a low pass on the measured speed."""
    speed_order: Order = "first"
    """Order of the low pass on the measured speed."""
    reference_low_pass: _Frequencies = field(None, unit="Hz")
    """Natural frequency f of a command filter on the speed reference, of second order without
    overshoot. A step of acceleration a becomes a jerk of at most 2 pi f a / e."""

    @property
    def frequencies(self) -> dict[str, Sequence[float]]:
        """Frequencies of all filters by their fields, without filters that are not used [Hz]."""
        names = ("notch_frequency", "torque_low_pass", "speed_low_pass", "reference_low_pass")
        given = {name: getattr(self, name) or () for name in names}
        return {name: values for name, values in given.items() if any(values)}

    def sections(self) -> dict[str, list[Section]]:
        """Return the filters in use by the blocks that they make, one for each joint."""
        found = {}
        for name, values in self.frequencies.items():
            found[name.removesuffix("_frequency")] = [
                self._section(name, 2 * np.pi * f, k) if f else PASS for k, f in enumerate(values)
            ]
        return found

    def _section(self, name: str, omega: float, k: int) -> Section:
        if name == "notch_frequency":
            depth = 0.1 if self.notch_depth is None else self.notch_depth[k]
            width = 1.0 if self.notch_width is None else self.notch_width[k]
            return notch(omega, depth=depth, width=width)
        if name == "reference_low_pass":
            return low_pass(omega, damping=1.0)
        order = self.torque_order if name == "torque_low_pass" else self.speed_order
        return low_pass(omega, order=1 if order == "first" else 2)
