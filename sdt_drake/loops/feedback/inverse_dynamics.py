"""Feedback linearisation by one controller of all joints, at the interpolation period."""

from __future__ import annotations

from pydrake.systems.framework import OutputPort

from sdt_drake.control import damping_ratio
from sdt_drake.loops.builder import DesignLoopBuilder
from sdt_drake.systems import Block, inverse_dynamics_block


def place(loop: DesignLoopBuilder, reference: OutputPort, measured: OutputPort) -> Block:
    design = loop.design
    state = loop.place_encoder("encoder", measured, loop.motion.period)
    controller = loop.place(
        "inverse_dynamics",
        inverse_dynamics_block,
        model=design.model,
        omega_n=design.omega_n,
        zeta=damping_ratio(design.gains, design.gains.ki / design.omega_n**2),
    )
    loop.connect(reference, controller.inputs["reference"])
    loop.connect(state, controller.inputs["state"])
    return controller
