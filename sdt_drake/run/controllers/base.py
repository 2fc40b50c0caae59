"""The base classes of controllers: options that make their feedback, and systems of your own."""

from __future__ import annotations

import warnings
from typing import Any, cast

from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, System

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.run.design import Design
from sdt_drake.run.options import ControllerOptions

LOOP_SIGNALS = (
    "reference", "measured", "sampled_state", "load_torque", "tau_cmd", "tau_limited",
)  # fmt: skip
"""Signals of the loop that can be inputs of a controller."""


class Feedback(ControllerOptions):
    """Options that make the diagram of their controller's feedback, start it and describe it."""

    def feedback(self, design: Design) -> System:
        """Make the feedback of a design, from signals of the loop to `tau_fb` or `tau_cmd`."""
        raise NotImplementedError

    def linear(self, design: Design, sample: int) -> System:
        """Make the feedback alone, around a sample of the motion, for linear analysis.

        Raises:
            InputError: if there is no feedback that Drake can linearise.
        """
        text = f"controller.kind {self.kind}: has no linear feedback (Controller.linear)"
        raise InputError(text)

    def start(
        self, system: System, context: Context, design: Design, tau: Array, start: Motion | None
    ) -> None:
        """Set the state of the feedback so that its output is a torque in steady motion.

        Args:
            system: the system that `feedback` made.
            context: a context of the system.
            design: the design of the loop.
            tau: the output, motor side [N m], shape (n,).
            start: a motion of one sample, without acceleration; None for the first of the motion.
        """

    def in_words(self, design: Design) -> str:
        """Describe the feedback of a design in words."""
        return self.title

    @property
    def title(self) -> str:
        """Name of the controller in messages: its class."""
        return type(self).__name__


def feedback_of(design: Design) -> Feedback:
    """Return the controller of a design's scenario: each that is registered is a `Feedback`."""
    return cast(Feedback, design.scenario.controller)


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
    """Set the state of a controller of your own; see `Feedback.start`."""
    if not isinstance(system, Controller):
        return
    given: tuple[Any, ...] = () if start is None else (start,)
    if hasattr(system, "rest"):
        name = type(system).__name__
        warnings.warn(
            f"{name}.rest is deprecated and goes in 0.7, name it set_steady_state",
            DeprecationWarning,
            stacklevel=2,
        )
        system.rest(context, tau, *given)
    system.set_steady_state(context, tau, *given)
