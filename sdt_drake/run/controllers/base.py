"""The base class of controllers."""

from __future__ import annotations

import warnings
from dataclasses import fields
from typing import ClassVar, cast

from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, System

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.run.design import Design
from sdt_drake.run.kinds import CONTROLLERS, Kind


class Controller:
    """The base class of controllers.

    Derive from a Drake system and from this class, then register the result. The constructor takes
    a `Design`. The output is `tau_cmd` [N m], motor side, or `tau_fb`, to which the loop adds the
    feedforward of the scenario. Inputs are named after signals of the loop, which
    `sdt_drake.systems` describes: `reference`, `measured` (at the drive period if the drive
    samples), `sampled_state`, `load_torque`, `tau_cmd`, `tau_limited`. The class attributes are the
    fields of `kinds.Kind`.
    """

    needs: ClassVar[tuple[str, ...]] = ()
    plants: ClassVar[tuple[str, ...]] = ("axis", "coupled")
    options: ClassVar[tuple[str, ...]] = ()
    feedforward: ClassVar[str] = "none"
    structure: ClassVar[str | None] = None
    takes_feedforward: ClassVar[bool] = False

    def __init_subclass__(cls, kind: str | None = None) -> None:
        """Set the attributes of a shipped class to those of its kind."""
        if kind is not None:
            for attribute in fields(Kind):
                setattr(cls, attribute.name, getattr(CONTROLLERS[kind], attribute.name))

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


LOOP_SIGNALS = (
    "reference", "measured", "sampled_state", "load_torque", "tau_cmd", "tau_limited",
)  # fmt: skip
"""Signals of the loop that can be inputs of a controller."""


class Shipped(Controller):
    """A shipped controller: functions that make the diagram of its feedback, and start it."""

    @classmethod
    def diagram(cls, design: Design, at: int | None = None) -> Diagram:
        """Make the feedback of a design, from signals of the loop to `tau_fb`.

        Args:
            design: the design of the loop.
            at: a sample for linear analysis: the feedback with its gains there.
        """
        raise NotImplementedError

    @classmethod
    def linear(cls, design: Design, sample: int) -> System:
        return cls.diagram(design, sample)

    @classmethod
    def start(
        cls, system: Diagram, context: Context, design: Design, tau_fb: Array, start: Motion | None
    ) -> None:
        """Set the state of the diagram so that it commands `tau_fb` in steady motion."""


def start_controller(
    owner: type,
    system: System,
    context: Context,
    design: Design,
    tau_cmd: Array,
    start: Motion | None,
) -> None:
    """Set the state of a controller so that the loop commands a torque in steady motion.

    Args:
        owner: class of the controller.
        system: its system.
        context: a context of the system.
        design: the design of the loop.
        tau_cmd: the command, motor side [N m], shape (n,).
        start: a motion of one sample, without acceleration; None for the first of the motion.
    """
    if system.HasOutputPort("tau_fb"):  # the loop adds the feedforward
        tau_cmd = tau_cmd - (design.steady_ff if start is None else design.steady_ff_at(start))
    if issubclass(owner, Shipped):
        owner.start(cast(Diagram, system), context, design, tau_cmd, start)
    elif isinstance(system, Controller):
        given = () if start is None else (start,)
        if hasattr(system, "rest"):
            warnings.warn(
                f"{owner.__name__}.rest is deprecated and goes in 0.7, name it set_steady_state",
                DeprecationWarning,
                stacklevel=2,
            )
            system.rest(context, tau_cmd, *given)
        system.set_steady_state(context, tau_cmd, *given)
