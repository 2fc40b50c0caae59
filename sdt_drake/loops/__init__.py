"""The control loops, as Drake diagrams of the same blocks.

Each can be built for two uses: `boxed=False` to simulate, with all systems side by side and logs;
`boxed=True` to export, with one box for each block of the paper's figures and no logs. The wiring
is the same.
"""

from sdt_drake.loops.builder import loop_period
from sdt_drake.loops.feedback.speed import PI_NAME
from sdt_drake.loops.make import (
    make_axis_loop,
    make_coupled_loop,
    make_feedback,
    make_loop,
    make_process,
    make_step_loop,
)
from sdt_drake.loops.plant import PLANT_NAME

__all__ = [
    "PI_NAME",
    "PLANT_NAME",
    "loop_period",
    "make_axis_loop",
    "make_coupled_loop",
    "make_feedback",
    "make_loop",
    "make_process",
    "make_step_loop",
]
