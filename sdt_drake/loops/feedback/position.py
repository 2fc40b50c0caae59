"""Position feedback: the industrial cascade, a position loop around the speed loop."""

from __future__ import annotations

from pydrake.systems.framework import OutputPort

from sdt_drake.loops.builder import DesignLoopBuilder
from sdt_drake.loops.feedback import speed
from sdt_drake.systems import Block, position_loop_block


def place(loop: DesignLoopBuilder, reference: OutputPort, measured: OutputPort) -> Block:
    state = speed.sampled(loop, measured)
    # At the instants of the reference: see position_loop_block.
    sample = loop.place_encoder("position_encoder", measured, loop.motion.period)
    outer = loop.place(
        "position_loop", position_loop_block, position_gain=loop.design.position_gain
    )
    loop.connect(reference, outer.inputs["reference"])
    loop.connect(sample, outer.inputs["state"])
    return speed.place_pi(loop, outer.outputs["reference"], state)
