"""What every controller tells of itself."""

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
    """What makes a Drake system a controller here: derive from a system and from this, and register
    it.

    The system is made with a `Design`, and has the output `tau_cmd` [N m], motor side, and inputs
    named after signals of the loop, which `sdt_drake.systems` describes: `reference`, `state` (as
    measured, at the period of the drive if that has one), `sampled_state`, `load_torque`,
    `tau_limited`.

    Attributes:
        needs: what must be known to commission it, beside what its feedforward needs.
        plants: on which it makes sense.
        options: fields of the scenario's `controller` that it takes, of `kinds.OPTIONS`.
        feedforward: torque feedforward where that is no option: "none", "ctc" or "id".
        structure: of its PI controllers; None where the scenario chooses it.
        takes_feedforward: whether any torque feedforward can be added to its command.
    """

    needs: ClassVar[tuple[str, ...]] = ()
    plants: ClassVar[tuple[str, ...]] = ("axis", "coupled")
    options: ClassVar[tuple[str, ...]] = ()
    feedforward: ClassVar[str] = "none"
    structure: ClassVar[str | None] = None
    takes_feedforward: ClassVar[bool] = False

    def __init_subclass__(cls, kind: str | None = None) -> None:
        """Give a class that ships with the package the attributes of its kind."""
        if kind is not None:
            for attribute in fields(Kind):
                setattr(cls, attribute.name, getattr(CONTROLLERS[kind], attribute.name))

    @classmethod
    def in_words(cls, design: Design) -> str:
        """What the feedback is, in words, with what a design has of it."""
        return cls.__name__

    @classmethod
    def linear(cls, design: Design, sample: int) -> System:
        """The feedback alone, as it is around a sample of the motion: for linear analysis.

        Raises:
            InputError: if it has none that Drake can linearise.
        """
        kind = design.scenario.controller.kind
        raise InputError(f"controller.kind {kind}: has no linear feedback (Controller.linear)")

    def rest(self, context: Context, tau_cmd: ArrayLike, start: Motion | None = None) -> None:
        """Start with that command, on the reference; nothing to do for one without a memory. Holds
        and tables are memory, too.

        Args:
            context: of this system.
            tau_cmd: the command, motor side [N m], shape (n,).
            start: the sample to start at, without acceleration; given where that is not the first
                of the motion.
        """

    def after_updates(self, tau_cmd: Array, measured: Array, held: Index) -> Array:
        """Return the command just after each update, motor side [N m], shape (M, n).

        Optional: a class that has it spares a run stopping at each update to look at the command.
        The reference arrives with the updates here.

        Args:
            tau_cmd: just before each of M + 1 updates [N m], shape (M + 1, n).
            measured: q and v as measured at the samples of the reference, joint side [rad, rad/s],
                shape (N + 1, 2 n); M = N where drives are continuous.
            held: sample of the reference in force after each update, shape (M,).
        """
        raise NotImplementedError


LOOP_SIGNALS = ("reference", "state", "sampled_state", "load_torque", "tau_limited")
"""What a controller can have of the loop, by the names of its inputs."""


class Shipped(Diagram, Controller):
    """A controller that ships with the package: a law, the torque feedforward behind it, tables."""

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
        """Add the torque feedforward of a design, from tau_fb to tau_cmd, and connect all by name;
        none `at` a sample, where it stands still."""
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
    """Signals along the motion that arrive with the reference."""
    delay = design.drive.reference_delay
    return SignalTable(motion=design.reference, signals=signals, delay=delay)
