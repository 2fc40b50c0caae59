"""The base classes of controllers."""

from __future__ import annotations

from dataclasses import fields
from typing import ClassVar

from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System

from sdt_drake.io.arrays import Array, Index
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.run.design import Design
from sdt_drake.run.kinds import CONTROLLERS, Kind
from sdt_drake.systems import CtcFeedforward, ReferenceTorque, SignalTable
from sdt_drake.systems.wiring import Aliases, connect_by_name


class Controller:
    """The base class of controllers.

    Derive from a Drake system and from this class, then register the result. The constructor takes
    a `Design`. The output is `tau_cmd` [N m], motor side. Inputs are named after signals of the
    loop, which `sdt_drake.systems` describes: `reference`, `state` (measured, at the drive period
    if the drive samples), `sampled_state`, `load_torque`, `tau_limited`. The class attributes are
    the fields of `kinds.Kind`.
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

    def rest(self, context: Context, tau_cmd: ArrayLike, start: Motion | None = None) -> None:
        """Set the state so that the controller commands a torque in steady motion.

        A controller without state, holds or tables needs no such method.

        Args:
            context: a context of this system.
            tau_cmd: the command, motor side [N m], shape (n,).
            start: a motion of one sample, without acceleration; None for the first of the motion.
        """

    def after_updates(self, tau_cmd: Array, measured: Array, held: Index) -> Array:
        """Return the command just after each update, motor side [N m], shape (M, n).

        This method is optional. Without it a run stops at each update to evaluate the command. It
        is only called if the reference arrives with the updates.

        Args:
            tau_cmd: command just before each of M + 1 updates [N m], shape (M + 1, n).
            measured: q and v measured at the samples of the reference, joint side [rad, rad/s],
                shape (N + 1, 2 n); M = N for continuous drives.
            held: sample of the reference in force after each update, shape (M,).
        """
        raise NotImplementedError


LOOP_SIGNALS = ("reference", "state", "sampled_state", "load_torque", "tau_limited")
"""Signals of the loop that can be inputs of a controller."""


class Shipped(Diagram, Controller):
    """A shipped controller: a feedback law, a torque feedforward behind it, and tables."""

    def __init__(self) -> None:
        super().__init__()
        self._tables: list[SignalTable] = []

    def rest(self, context: Context, tau_cmd: ArrayLike, start: Motion | None = None) -> None:
        for table in self._tables:
            table.rest(self.GetMutableSubsystemContext(table, context))

    def _add_table(
        self, builder: DiagramBuilder, name: str, design: Design, **signals: Array
    ) -> None:
        self._tables.append(table_of(design, **signals))
        builder.AddNamedSystem(name, self._tables[-1])

    def _build(
        self, builder: DiagramBuilder, design: Design, at: int | None, aliases: Aliases
    ) -> None:
        """Add the torque feedforward, from tau_fb to tau_cmd, and connect all blocks by name.

        Around a sample, `at`, there is no feedforward, as the robot is at rest.
        """
        aliases, tau_cmd, law = dict(aliases), "tau_cmd", design.feedforward
        if at is not None or design.tau_ff is None:
            tau_cmd = aliases["pi_speed_controller", "tau_cmd"] = "tau_fb"
        else:
            builder.AddNamedSystem("ctc_feedforward", CtcFeedforward(n=design.robot.n))
            if design.feeds_load_torque:
                aliases["ctc_feedforward", "tau_ff"] = "load_torque"
            elif law is None or design.scenario.inverse_dynamics == "table":
                self._add_table(builder, "feedforward_table", design, tau_ff=design.tau_ff)
            else:
                torque = ReferenceTorque(
                    robot=design.model, outputs=("tau_ff",), law=lambda *sample: [law(*sample)]
                )
                builder.AddNamedSystem("feedforward_torque", torque)
        builder.ExportOutput(connect_by_name(builder, aliases)[tau_cmd], "tau_cmd")
        builder.BuildInto(self)


def table_of(design: Design, **signals: Array) -> SignalTable:
    """Make a table of signals along the motion that arrive with the reference."""
    delay = design.drive.reference_delay
    return SignalTable(motion=design.reference, signals=signals, delay=delay)
