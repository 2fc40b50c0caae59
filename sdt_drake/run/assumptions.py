"""Variants of a device that an analysis needs and no scenario has."""

from dataclasses import dataclass, replace
from typing import cast

from sdt_drake.io.arguments import finite
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion


@dataclass(frozen=True, eq=False)
class Assumptions:
    """Assumptions of an analysis about the device, unlike the scenario; none by default."""

    limited: bool = True
    """True if the motors have limits. Without, peak and saturation in a `Recording` have no
    meaning."""
    widened: bool | None = None
    """True if the alleviating torque widens the motors' limits; by default on the axis plant."""
    loaded: bool = True
    """True if the load torque of the reference acts on the axis plant, and its disturbance."""
    prescribed_motion: tuple[Array, Array] | None = None
    """Prescribed joint motion: q [rad] and v [rad/s] at the samples of the motion, joint side,
    shape (N + 1, n) each. The motors then have no effect, and the log shows what the controller
    would command."""

    def checked(self, motion: Motion) -> "Assumptions":
        """Return the assumptions with a prescribed motion of finite samples, like those of motion.

        Raises:
            InputError: if the prescribed motion has other samples or joints.
        """
        if self.prescribed_motion is None:
            return self
        checked = []
        for i, samples in enumerate(self.prescribed_motion):
            place = f"prescribed_motion[{i}]"
            values = cast(Array, finite("(N + 1, n)")(samples, place))
            if values.shape != motion.q.shape:
                text = f"of shape {values.shape}, expected {motion.q.shape}"
                raise InputError(text, place=place)
            checked.append(values)
        q, v = checked
        return replace(self, prescribed_motion=(q, v))
