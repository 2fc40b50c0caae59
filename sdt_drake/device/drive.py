"""The electric drive of the motors: its sampling, torque loop, encoder and envelope."""

# Drake's YAML loader reads the annotations: not postponed, Optional[...] in full.
from dataclasses import dataclass
from typing import Optional

import numpy as np

from sdt_drake.errors import InputError, checked_number, checked_vector, whole_periods

SHORTEST_PERIOD = 125e-6  # s; the speed loop of SINAMICS S120, servo control at 4 kHz


@dataclass
class Drive:
    """What lies between the controller's law and the torque of the motors.

    Everything is ideal unless given. Lists have one value for each joint.

    Attributes:
        period: sampling period of the speed loop [s]; 125 µs to the interpolation period, which it
            must divide. Continuous by default.
        torque_bandwidth: -3 dB frequency of the torque loop, a first-order lag [Hz].
        torque_error: the motors give (1 + torque_error) of the torque they should [-].
        encoder_resolution: increments of each encoder per revolution **of the motor** [-]; speed is
            then the difference of positions over `period`.
        n1: motor speed up to which the full torque is available [rad/s], motor side.
        n0: motor speed at which none is left to accelerate any more [rad/s], motor side.
        reference_delay: how late the reference and all that is computed from it arrives [s].
    """

    period: Optional[float] = None  # noqa: UP045
    torque_bandwidth: Optional[float] = None  # noqa: UP045
    torque_error: Optional[list[float]] = None  # noqa: UP045
    encoder_resolution: Optional[list[float]] = None  # noqa: UP045
    n1: Optional[list[float]] = None  # noqa: UP045
    n0: Optional[list[float]] = None  # noqa: UP045
    reference_delay: float = 0.0

    def validate(self, where: str, period: float) -> None:
        """Check what does not need the robot; `period` is the interpolation period [s].

        Raises:
            InputError: naming the field below `where`.
        """
        if self.period is not None:
            checked_number(self.period, f"{where}.period", minimum=0, exclusive=True)
            if self.period < SHORTEST_PERIOD * (1 - 1e-9):
                raise InputError(
                    f"{where}.period: {self.period:g} s, expected at least {SHORTEST_PERIOD:g} s"
                )
            if self.period > period * (1 + 1e-9):
                raise InputError(
                    f"{where}.period: {self.period:g} s, expected at most the interpolation "
                    f"period, {period:g} s"
                )
            try:
                whole_periods(period, self.period, where)
            except InputError:
                raise InputError(
                    f"{where}.period: {self.period:g} s does not divide the interpolation period, "
                    f"{period:g} s"
                ) from None
        if self.torque_bandwidth is not None:
            checked_number(
                self.torque_bandwidth, f"{where}.torque_bandwidth", minimum=0, exclusive=True
            )
        checked_number(self.reference_delay, f"{where}.reference_delay", minimum=0)
        if self.encoder_resolution is not None and self.period is None:
            raise InputError(f"{where}.encoder_resolution: needs {where}.period, to take the speed")
        if (self.n1 is None) != (self.n0 is None):
            raise InputError(f"{where}: n1 and n0 must be given together")

    def validate_sizes(self, n: int, where: str) -> None:
        """Check that every list has one good value for each of the n joints.

        Raises:
            InputError: naming the field below `where`.
        """
        for name in ("encoder_resolution", "n1", "n0"):
            values = getattr(self, name)
            if values is not None:
                checked_vector(values, n, f"{where}.{name}", positive=True)
        if self.encoder_resolution is not None and np.any(np.array(self.encoder_resolution) < 1):
            raise InputError(
                f"{where}.encoder_resolution: {self.encoder_resolution}, expected at least 1"
            )
        if self.n1 is not None and np.any(np.array(self.n1) >= np.array(self.n0)):
            raise InputError(f"{where}.n0: {self.n0}, expected more than n1, {self.n1}, everywhere")
        if self.torque_error is not None:
            error = checked_vector(self.torque_error, n, f"{where}.torque_error")
            if np.any(np.abs(error) >= 1):
                raise InputError(
                    f"{where}.torque_error: {self.torque_error}, expected shares between -1 and 1"
                )
