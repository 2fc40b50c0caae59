"""The windings of motors: how much their losses warm them, and how fast."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import Input, Number, Problems, field
from sdt_drake.robot.motors import Motor


@dataclass(frozen=True)
class WindingChoice(Input):
    """The temperature of the motors' windings, with the data of the catalogue; none by default."""

    coolant: Number | None = field(None, ge=-50, le=150, unit="°C")
    """Temperature of the coolant. Without it there are no temperatures. With it each motor of the
    device must be in the catalogue: `device.motors` or `device.fitted`."""
    initial: Number | None = field(None, ge=-50, le=300, unit="°C")
    """Temperature of the windings at the start; that of the coolant by default."""

    def problems(self) -> Problems:
        if self.coolant is None and self.initial is not None:
            yield "coolant", "missing, expected the temperature of the coolant"


@dataclass(frozen=True, eq=False)
class Windings:
    """The windings of n motors, each warmed in m parts; motor side."""

    rated_torque: Array
    """Torque that a motor can give for ever [N m], shape (n,)."""
    rise: Array
    """Rise above the coolant at constant rated torque [K], shape (n,)."""
    limit: Array
    """Largest temperature [°C], shape (n,)."""
    time_constant: Array
    """Time constants of the parts: winding, and housing if it counts [s], shape (m, n)."""
    share: Array
    """Shares of the parts in the rise in the end [-], shape (m, n); their sum is 1."""
    coolant: float = 0.0
    """Temperature of the coolant [°C]."""
    initial: float = 0.0
    """Temperature at the start [°C]."""

    @property
    def start(self) -> Array:
        """Relative rise of all parts at the start [-], shape (m, n)."""
        relative = (self.initial - self.coolant) / self.rise
        return np.broadcast_to(relative, self.share.shape)

    def temperature(self, rises: NDArray[Any]) -> Array:
        """Return the temperature [°C], (..., n), of the relative rise of each part, (..., m, n).

        Numbers or symbols.
        """
        return np.asarray(self.coolant + self.rise * (self.share * rises).sum(axis=-2))


def windings_of(motors: Sequence[Motor], choice: WindingChoice | None = None) -> Windings:
    """Return the windings of the motors of all joints."""

    def each(name: str) -> Array:
        return np.array([getattr(motor, name) for motor in motors])

    T, share = each("thermal_time_constant"), each("housing_share")
    slow = np.array([m.housing_time_constant or m.thermal_time_constant for m in motors])
    coolant = 0.0 if choice is None or choice.coolant is None else choice.coolant
    initial = coolant if choice is None or choice.initial is None else choice.initial
    parts = 2 if share.any() else 1
    return Windings(
        each("rated_torque"),
        each("winding_rise"),
        each("winding_limit"),
        np.stack([T, slow])[:parts],
        np.stack([1 - share, share])[:parts],
        coolant,
        initial,
    )
