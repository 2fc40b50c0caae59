"""The electric drive of the motors: its sampling, torque loop, encoder and envelope."""

# Real annotations, for the check of the fields (sdt_drake.fields): they may not be postponed.
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Optional

from sdt_drake.fields import setting

SHORTEST_PERIOD = 125e-6  # s; the speed loop of SINAMICS S120, servo control at 4 kHz


@dataclass(slots=True)
class Drive:
    """What lies between the controller's law and the torque of the motors.

    Everything is ideal unless given. Lists have one value for each joint.

    Attributes:
        period: sampling period of the speed loop; 125 µs to the interpolation period, which it
            must divide. Continuous by default.
        torque_bandwidth: -3 dB frequency of the torque loop, a first-order lag.
        torque_error: the motors give (1 + torque_error) of the torque they should.
        encoder_resolution: increments of each encoder per revolution **of the motor**; speed is
            then the difference of positions over `period`.
        n1: motor speed up to which the full torque is available.
        n0: motor speed at which none is left to accelerate any more.
        reference_delay: how late the reference and all that is computed from it arrives.
    """

    period: Optional[float] = setting(None, minimum=SHORTEST_PERIOD, unit="s")
    torque_bandwidth: Optional[float] = setting(None, above=0, unit="Hz")
    torque_error: Optional[list[float]] = setting(None, above=-1, below=1, per_joint=True, unit="-")
    encoder_resolution: Optional[list[float]] = setting(
        None, minimum=1, per_joint=True, unit="1/rev", side="motor"
    )
    n1: Optional[list[float]] = setting(None, above=0, per_joint=True, unit="rad/s", side="motor")
    n0: Optional[list[float]] = setting(None, above=0, per_joint=True, unit="rad/s", side="motor")
    reference_delay: float = setting(0.0, minimum=0, unit="s")

    def problems(self) -> Iterator[tuple[str, str]]:
        if self.encoder_resolution is not None and self.period is None:
            yield "encoder_resolution", "needs period, to take the speed"
        if (self.n1 is None) != (self.n0 is None):
            yield "n1" if self.n1 is None else "n0", "missing, expected n1 and n0 or neither"
        elif self.n1 and self.n0 and any(a >= b for a, b in zip(self.n1, self.n0, strict=False)):
            yield "n0", f"{self.n0}, expected more than n1, {self.n1}, everywhere"
