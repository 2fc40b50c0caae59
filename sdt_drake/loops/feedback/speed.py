"""Speed feedback: a PI controller for each motor (Section 3.3), sampled where the drive is."""

from __future__ import annotations

from pydrake.systems.framework import OutputPort

from sdt_drake.loops.builder import DesignLoopBuilder
from sdt_drake.systems import Block, pi_speed_controller_block

PI_NAME = "pi_speed_controller"
"""Name of the system whose state is the integral of the speed error; with anti-windup its part
"integral"."""


def place(loop: DesignLoopBuilder, reference: OutputPort, measured: OutputPort) -> Block:
    return place_pi(loop, reference, sampled(loop, measured))


def sampled(loop: DesignLoopBuilder, measured: OutputPort) -> OutputPort:
    """`measured` as the speed loop sees it: at the period of the drive, if that has one."""
    if loop.drive.period is None:
        return measured
    return loop.place_encoder("encoder", measured, loop.drive.period)


def place_pi(loop: DesignLoopBuilder, reference: OutputPort, state: OutputPort) -> Block:
    """The PI controllers."""
    design, choice = loop.design, loop.design.scenario.controller
    controller = loop.place(
        PI_NAME,
        pi_speed_controller_block,
        gains=design.gains,
        gear_ratio=design.robot.gear_ratio,
        structure=choice.structure_in_use,
        anti_windup=choice.anti_windup and loop.frozen_at is None,  # nothing saturates there
        period=loop.drive.period,
        elements=loop.boxed,
    )
    loop.connect(reference, controller.inputs["reference"])
    loop.connect(state, controller.inputs["state"])
    return controller
