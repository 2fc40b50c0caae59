"""Torque feedforward from a model of the robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.arrays import Array
from sdt_drake.dynamics import decouple
from sdt_drake.robot import Robot

FEEDFORWARDS = ("none", "ctc", "id")
"""None, the load torque of Algorithm 1, or the whole inverse dynamics."""


def feedforward_torque(
    feedforward: str, model: Robot, groups: Sequence[ArrayLike], vd: Array, sign: str
) -> Array:
    """What the model says that the motors need, **motor side** [N m], shape (n,) or (N, n).

        "ctc":  tau_LD of Algorithm 1
        "id":   (inertial + reaction + velocity + gravity + r² I_m vd) / r

    Args:
        feedforward: "none", "ctc" or "id".
        model: what the controller takes the robot for.
        groups: its torque groups (Eq. 2), joint side: inertial, reaction, velocity, gravity.
        vd: reference acceleration, joint side [rad/s²].
        sign: of Algorithm 1's third branch.
    """
    inertial, reaction, velocity, gravity = (np.asarray(group) for group in groups)
    coupled = reaction + velocity + gravity
    if feedforward == "none":
        return np.zeros_like(inertial)
    if feedforward == "ctc":
        return decouple(inertial, coupled, model.gear_ratio, sign).load_torque
    return (inertial + coupled + model.reflected_inertia * vd) / model.gear_ratio
