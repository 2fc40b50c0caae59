"""The control loops, as Drake diagrams."""

from sdt_drake.loops.device import make_process
from sdt_drake.loops.make import Loop, blocks_of, make_loop, make_step_loop, systems_in

__all__ = ["Loop", "blocks_of", "make_loop", "make_process", "make_step_loop", "systems_in"]
