"""Loops and blocks are freed when nobody has them any more."""

import gc
import subprocess
import sys
import weakref
from functools import partial
from pathlib import Path

import pytest
from helpers import alone
from helpers.robots import WRIST, loaded
from pydrake.systems.framework import LeafSystem

from sdt_drake.io.resources import shipped
from sdt_drake.run.controllers import Controller, register_controller
from sdt_drake.run.loop import make_loop
from sdt_drake.systems import robot_plant

LOOPS = Path(__file__).parents[1] / "helpers" / "dropped_loops.py"


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_dropped_loops_leave_no_memory():
    """Of every shipped scenario, and with torques on line, which are Python; each kept 0.6 MB."""
    command = [sys.executable, LOOPS, "80", *shipped("scenario")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert float(done.stdout) < 20  # MB


def kept(**systems):
    """Names of systems that are not gone with their last name; functions make them."""
    gone = {}
    for name, make in systems.items():
        made = make()
        made.CreateDefaultContext()
        gone[name] = weakref.ref(made)
    del made
    gc.collect()
    return [name for name, ref in gone.items() if ref() is not None]


def test_dropped_blocks_are_freed(robot, meshcat):
    drawn = {"robot_drawing": {"meshcat": meshcat}}
    make = {x: partial(alone.made, x, robot, **drawn.get(x, {})) for x in alone.ARGUMENTS}
    assert not kept(**make)


class Tidy(LeafSystem, Controller):
    """A controller in Python that can be freed, as the page on controllers tells."""

    __slots__ = ()

    def __init__(self, design):
        super().__init__()
        own, n = weakref.proxy(self), design.device.simulated.n
        self.measured = self.DeclareVectorInputPort("measured", 2 * n)
        inputs = {self.measured.ticket()}
        self.DeclareVectorOutputPort("tau_cmd", n, lambda *of: own.command(*of), inputs)

    def command(self, context, output):
        output.SetFromVector(-self.measured.Eval(context)[output.size() :])


def test_dropped_loop_with_python_controller_is_freed(designed):
    register_controller("tidy", Tidy)
    design = designed("coupled_pi", {"controller.kind": "tidy"}, end=0.1)
    assert not kept(tidy=lambda: make_loop(design).diagram)


def test_dropped_coupled_and_drawn_loops_are_freed(designed, meshcat):
    wrist, design = loaded(WRIST), designed("coupled_pi", end=0.1)
    assert not kept(
        coupled=lambda: robot_plant(robot=wrist),
        slopes=lambda: robot_plant(robot=wrist).ToAutoDiffXd(),
        drawn=lambda: make_loop(design, meshcat=meshcat).diagram,
    )
