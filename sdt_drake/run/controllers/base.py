"""The base class of controllers of your own, and the signals that they may read."""

from typing import Any

from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, System

from sdt_drake.io.arrays import Array
from sdt_drake.io.deprecated import renamed
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.run.design import Design

LOOP_SIGNALS = (
    "reference", "measured", "sampled_state", "load_torque", "tau_cmd", "tau_limited",
)  # fmt: skip
"""Signals of the loop that can be inputs of a controller."""


class Controller:
    """The base class of your own controllers.

    Derive from a Drake system and from this class, then register the result. The constructor takes
    a `Design`. The output is `tau_cmd` [N m], motor side, or `tau_fb`, to which the loop adds the
    feedforward of the scenario. Inputs are named after signals of the loop, which
    `sdt_drake.systems` describes: `reference`, `measured` (at the drive period if the drive
    samples), `sampled_state`, `load_torque`, `tau_cmd`, `tau_limited`. Class attributes `needs`,
    `plants` and `takes_feedforward` replace those of its `ControllerOptions`.
    """

    __slots__ = ()

    @classmethod
    def in_words(cls, design: Design) -> str:
        """Describe the feedback of a design in words."""
        return cls.__name__

    @classmethod
    def linear(cls, design: Design, sample: int) -> System:
        """Make the feedback alone, around a sample of the motion, for linear analysis.

        Raises:
            InputError: if there is no feedback that Drake can linearise.
        """
        kind = design.scenario.controller.kind
        raise InputError(f"controller.kind {kind}: has no linear feedback (Controller.linear)")

    def set_steady_state(
        self, context: Context, tau: ArrayLike, start: Motion | None = None
    ) -> None:
        """Set the state so that the controller's output is a torque in steady motion.

        A controller without state, holds or tables needs no such method.

        Args:
            context: a context of this system.
            tau: the output, motor side [N m], shape (n,).
            start: a motion of one sample, without acceleration; None for the first of the motion.
        """


def start_own(system: System, context: Context, tau: Array, start: Motion | None) -> None:
    """Set the state of a controller of your own; see `ControllerOptions.start`."""
    if not isinstance(system, Controller):
        return
    given: tuple[Any, ...] = () if start is None else (start,)
    if hasattr(system, "rest"):
        renamed(f"{type(system).__name__}.rest", "set_steady_state")
        system.rest(context, tau, *given)
    system.set_steady_state(context, tau, *given)
