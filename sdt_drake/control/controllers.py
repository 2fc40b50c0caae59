"""The controllers by name: what each consists of, and what it has to know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sdt_drake.dynamics import decouple
from sdt_drake.errors import checked_choice
from sdt_drake.robot import Robot

Array = NDArray[np.float64]

FEEDFORWARDS = ("none", "ctc", "id")
"""Torque feedforward: none, the load torque of Algorithm 1, or the whole inverse dynamics."""


@dataclass(frozen=True)
class ControllerKind:
    """A controller: a feedback with or without a torque feedforward.

    Attributes:
        feedback: "speed", the PI speed controller; "position", a position loop around it;
            "scheduled", with gains that follow the inertia; or "inverse_dynamics".
        feedforward: one of FEEDFORWARDS, or None where the scenario chooses.
        structure: of the PI controller where the kind fixes it, else None: the scenario chooses.
        needs: what must be known to commission the feedback.
        plants: on which it makes sense.
    """

    feedback: str
    feedforward: str | None
    structure: str | None = None
    needs: tuple[str, ...] = ("largest inertia of each joint",)
    plants: tuple[str, ...] = ("axis", "coupled")


CONTROLLERS = {
    # Section 3.3: tau = K_IS int(v_ref - v) dt - K_PS v
    "pi": ControllerKind("speed", "none"),
    # Section 3.4: the same + tau_LD
    "pi_ctc": ControllerKind("speed", "ctc"),
    # + the whole inverse dynamics of the reference + K_PS v_ref: nothing is left for the feedback
    "pi_id": ControllerKind("speed", "id", structure="pi"),
    # v_ref + K_V (q_ref - q) as the reference of the speed loop
    "p_pi": ControllerKind("position", None, structure="pi"),
    # K_PS and K_IS in proportion to I_eff(q_ref)
    "pi_scheduled": ControllerKind("scheduled", None, needs=("inertia along the motion",)),
    # tau = M(q) (vd_ref + 2 zeta omega_n (v_ref - v) + omega_n² (q_ref - q)) + bias(q, v)
    "inverse_dynamics": ControllerKind(
        "inverse_dynamics",
        "none",
        needs=("links' masses and geometry", "motors' inertia", "state of all joints at once"),
        plants=("coupled",),
    ),
}

_FEEDFORWARD_NEEDS = {
    "none": (),
    "ctc": ("links' masses and geometry",),
    "id": ("links' masses and geometry", "motors' inertia"),
}


def needs(kind: str, feedforward: str) -> tuple[str, ...]:
    """What must be known to commission a controller with a feedforward."""
    return CONTROLLERS[kind].needs + _FEEDFORWARD_NEEDS[feedforward]


def feedforward_torque(
    feedforward: str, model: Robot, groups: Sequence[ArrayLike], vd: ArrayLike, sign: str
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

    Raises:
        InputError: for another feedforward or sign.
    """
    checked_choice(feedforward, FEEDFORWARDS, "feedforward")
    inertial, reaction, velocity, gravity = (np.asarray(group) for group in groups)
    coupled = reaction + velocity + gravity
    if feedforward == "none":
        return np.zeros_like(inertial)
    if feedforward == "ctc":
        return decouple(inertial, coupled, model.gear_ratio, sign).load_torque
    return (inertial + coupled + model.reflected_inertia * vd) / model.gear_ratio
