"""Brakes that close without power: that of a motor in a file, and those of all joints."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import Input, NotNegative, Positive, Problems, Text, field


@dataclass(frozen=True, kw_only=True)
class Brake(Input):
    """A brake on a motor's shaft that closes without power; **motor side**."""

    static_torque: Positive = field(unit="N m", side="motor")
    """Largest torque that the closed brake holds at rest."""
    dynamic_torque: Positive = field(unit="N m", side="motor")
    """Torque of the closed brake on a turning shaft, at most `static_torque`."""
    closing_delay: NotNegative = field(0.0, unit="s")
    """Time from the loss of power until the brake has its torque."""
    inertia: NotNegative = field(0.0, unit="kg m²", side="motor")
    """Inertia of the brake, in addition to `rotor_inertia`."""
    energy: Positive | None = field(None, unit="J")
    """Largest energy that the brake may take in one stop; unknown by default."""
    source: Text
    """Origin of the numbers."""

    def problems(self) -> Problems:
        if self.dynamic_torque > self.static_torque:
            text = f"expected at most static_torque, {self.static_torque:g}"
            yield "dynamic_torque", f"{self.dynamic_torque:g}, {text}"


@dataclass(frozen=True, eq=False)
class Brakes:
    """The brakes of n joints, **joint side**: arrays of shape (n,)."""

    static: Array
    """Largest torque that holds a joint at rest [N m]; 0 without a brake."""
    dynamic: Array
    """Torque on a moving joint [N m]; 0 without a brake."""
    delay: Array
    """Closing delay [s]; inf without a brake."""
    inertia: Array
    """Inertia of the brakes [kg m²]."""
    energy: Array
    """Largest energy of a stop [J]; inf if unknown."""
    source: tuple[str, ...] = ()
    """Origin of the numbers of each brake."""

    @staticmethod
    def of(brakes: Sequence[Brake | None], gear_ratio: Array) -> "Brakes":
        """Return the brakes of all joints from those of their motors; None for a joint without."""

        def each(name: str, without: float) -> Array:
            values = (without if brake is None else getattr(brake, name) for brake in brakes)
            return np.array([without if value is None else value for value in values], dtype=float)

        return Brakes(
            static=gear_ratio * each("static_torque", 0.0),
            dynamic=gear_ratio * each("dynamic_torque", 0.0),
            delay=each("closing_delay", np.inf),
            inertia=gear_ratio**2 * each("inertia", 0.0),
            energy=each("energy", np.inf),
            source=tuple("no brake" if brake is None else brake.source for brake in brakes),
        )
