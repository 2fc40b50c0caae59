"""A loop while it is built: its blocks, flat or boxed, its wires, and its logs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Diagram, DiagramBuilder, InputPort, OutputPort

from sdt_drake.design import Design
from sdt_drake.device import Drive
from sdt_drake.motion import Motion
from sdt_drake.systems import (
    Block,
    add_logs,
    constant_block,
    encoder_block,
    place_boxed,
    place_flat,
    table_block,
)

Array = NDArray[np.float64]


_BITS = 31  # of a period: 2^22 multiples of it are exact, and it is off by 5e-10 of itself at most


def loop_period(design: Design) -> float:
    """Interpolation period [s] of a loop: that of the motion, to 1e-9 of it.

    What samples at multiples of different periods has to meet, to the last bit: of two updates at
    one instant neither sees the other, and one that comes a bit later does. So where the drives
    sample several times per interpolation period, their period is rounded to so few bits that all
    multiples of both are exact.
    """
    period, samples = design.motion.period, _samples(design)
    if samples == 1:
        return period
    mantissa, exponent = math.frexp(period / samples)
    return samples * math.ldexp(round(math.ldexp(mantissa, _BITS)), exponent - _BITS)


def _samples(design: Design) -> int:
    """Of the drives in an interpolation period."""
    drive = design.scenario.drive
    if drive is None or drive.period is None:
        return 1
    return round(design.motion.period / drive.period)


class LoopBuilder:
    """Places blocks side by side to simulate, or each in a box to export."""

    def __init__(self, *, boxed: bool = False) -> None:
        self.boxed = boxed
        self._builder = DiagramBuilder()
        self._place_in = place_boxed if boxed else place_flat

    def place(self, name: str, describe: Callable[..., None], **arguments) -> Block:
        """A block, in a box of its own if the loop is boxed."""
        return self._place_in(self._builder, name, describe, **arguments)

    def place_open(self, name: str, describe: Callable[..., None], **arguments) -> Block:
        """A block whose inside is to be seen in an export too."""
        return place_flat(self._builder, name, describe, **arguments)

    def connect(self, output: OutputPort, target: InputPort) -> None:
        """Connect ports of two blocks."""
        self._builder.Connect(output, target)

    def export(
        self, name: str, inputs: Mapping[str, InputPort], outputs: Mapping[str, OutputPort]
    ) -> Diagram:
        """The diagram with ports of its own, and no logs."""
        for port_name, input_port in inputs.items():
            self._builder.ExportInput(input_port, port_name)
        for port_name, output_port in outputs.items():
            self._builder.ExportOutput(output_port, port_name)
        return self._build(name)

    def log(self, signals: Mapping[str, OutputPort], period: float) -> None:
        """Log signals at a period [s], if the loop is flat."""
        if not self.boxed:
            add_logs(self._builder, signals, period)

    def build(self, name: str) -> Diagram:
        """The diagram."""
        diagram = self._builder.Build()
        diagram.set_name(name)
        return diagram

    def _build(self, name: str) -> Diagram:
        diagram = self._builder.Build()
        diagram.set_name(name)
        return diagram


class DesignLoopBuilder(LoopBuilder):
    """The same for the loop of a design.

    Attributes:
        design: a resolved scenario.
        frozen_at: a sample of the motion, for linear analysis: tables stand still there, and
            encoders are ideal and never late. None: a loop that runs.
    """

    def __init__(
        self, design: Design, *, boxed: bool = False, frozen_at: int | None = None
    ) -> None:
        super().__init__(boxed=boxed)
        self.design = design
        self.frozen_at = frozen_at

    @cached_property
    def drive(self) -> Drive:
        """Of the scenario, on the clock of the loop; all ideal if it has none."""
        drive = self.design.scenario.drive or Drive()
        period, delay = drive.period, drive.reference_delay
        if period is not None:
            period = self.motion.period / _samples(self.design)
            if abs(delay / period - round(delay / period)) < 1e-6:
                delay = round(delay / period) * period
        return replace(drive, period=period, reference_delay=delay)

    @cached_property
    def motion(self) -> Motion:
        """Of the design, on the clock of the loop."""
        motion = self.design.motion
        return replace(motion, period=loop_period(self.design))

    def place_table(self, name: str, signals: Mapping[str, Array]) -> Block:
        """Signals along the motion, arriving with the reference."""
        if self.frozen_at is not None:
            ((signal, samples),) = signals.items()
            return self.place(name, constant_block, signal=signal, value=samples[self.frozen_at])
        return self.place(
            name,
            table_block,
            motion=self.motion,
            signals=signals,
            delay=self.drive.reference_delay,
        )

    def place_encoder(self, name: str, state: OutputPort, period: float) -> OutputPort:
        """`state` as an encoder sees it every `period` [s]."""
        if self.frozen_at is not None:
            return state
        encoder = self.place(
            name,
            encoder_block,
            n=self.design.robot.n,
            period=period,
            resolution=self.drive.encoder_resolution,
            gear_ratio=self.design.robot.gear_ratio,
        )
        self.connect(state, encoder.inputs["state"])
        return encoder.outputs["state"]
