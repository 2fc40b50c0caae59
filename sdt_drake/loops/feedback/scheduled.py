"""Speed feedback with gains that follow the inertia along the motion."""

from __future__ import annotations

from pydrake.systems.framework import OutputPort

from sdt_drake.loops.builder import DesignLoopBuilder
from sdt_drake.loops.feedback import speed
from sdt_drake.systems import Block, gain_schedule_block


def place(loop: DesignLoopBuilder, reference: OutputPort, measured: OutputPort) -> Block:
    state = speed.sampled(loop, measured)
    inertia = loop.place_table("inertia_table", {"inertia_share": loop.design.inertia_share})
    schedule = loop.place("gain_schedule", gain_schedule_block, n=loop.design.robot.n)
    loop.connect(reference, schedule.inputs["reference"])
    loop.connect(state, schedule.inputs["state"])
    loop.connect(inertia.outputs["inertia_share"], schedule.inputs["inertia_share"])
    return speed.place_pi(loop, schedule.outputs["reference"], schedule.outputs["state"])
