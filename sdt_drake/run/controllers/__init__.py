"""The controllers: a file for each with its options and its diagram; and your own."""

from collections.abc import Iterator
from contextlib import contextmanager

from pydrake.systems.framework import Context, System
from pydrake.systems.primitives import PassThrough

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, one_line
from sdt_drake.motion import Motion
from sdt_drake.run.controllers.base import Controller, start_own
from sdt_drake.run.controllers.inverse_dynamics import InverseDynamics
from sdt_drake.run.controllers.p_pi import PositionGain, PPi
from sdt_drake.run.controllers.pi import Pi, PiCtc, PiId, PiLoops
from sdt_drake.run.controllers.pi_scheduled import PiScheduled
from sdt_drake.run.controllers.registry import SHIPPED, Own, register_controller
from sdt_drake.run.design import Design
from sdt_drake.run.options import (
    CONTROLLERS,
    AntiWindup,
    ChosenFeedforward,
    ControllerOptions,
    FeedforwardGain,
    load_controllers,
    option_names,
)


def make_controller(design: Design) -> tuple[type, System]:
    """Return the class of the options of a design's controller, and its feedback as a system.

    Raises:
        InputError: if a controller of your own fails.
    """
    choice = design.scenario.controller
    with own_code(design, type(choice)):
        return type(choice), choice.feedback(design)


def in_errors(design: Design, owner: type) -> str:
    """Return the name of a controller in error messages: its kind, if it has one, and its class.

    Args:
        design: the design of the loop.
        owner: class of the options of the scenario's controller, or of a system from outside.
    """
    if owner is PassThrough:  # an input of the loop
        return "external controller"
    choice = design.scenario.controller
    if owner is type(choice):
        return f"controller '{choice.kind}' (class {choice.title})"
    return f"controller (class {owner.__name__})"


@contextmanager
def own_code(design: Design, owner: type) -> Iterator[None]:
    """Attribute errors raised by your own controller, SystemExit included, to that controller."""
    try:
        yield
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        if owner in (*SHIPPED.values(), PassThrough):
            raise
        text = f"{type(error).__name__}: {one_line(error)}"
        raise InputError(f"{in_errors(design, owner)}: fails ({text})") from error


def start_controller(
    owner: type,
    system: System,
    context: Context,
    design: Design,
    tau_cmd: Array,
    start: Motion | None,
) -> None:
    """Set the state of a controller so that the loop commands a torque in steady motion.

    Args:
        owner: class of the options of the scenario's controller, or of a system from outside.
        system: its system.
        context: a context of the system.
        design: the design of the loop.
        tau_cmd: the command, motor side [N m], shape (n,).
        start: a motion of one sample, without acceleration; None for the first of the motion.
    """
    if system.HasOutputPort("tau_fb"):  # the loop adds the feedforward
        added = design.tuning.feedforward
        tau_cmd = tau_cmd - (added.steady if start is None else added.steady_at(start))
    choice = design.scenario.controller
    if owner is type(choice):
        choice.start(system, context, design, tau_cmd, start)
    else:
        start_own(system, context, tau_cmd, start)
