"""The controllers as Drake systems: shipped classes, and registration of your own."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from itertools import takewhile
from typing import cast

from pydrake.systems.framework import System
from pydrake.systems.primitives import PassThrough

from sdt_drake.io.errors import InputError, one_line
from sdt_drake.run.controllers.base import Controller, Shipped, start_controller
from sdt_drake.run.controllers.inverse_dynamics import InverseDynamics
from sdt_drake.run.controllers.p_pi import PPi
from sdt_drake.run.controllers.pi import Pi, PiCtc, PiId
from sdt_drake.run.controllers.pi_scheduled import PiScheduled
from sdt_drake.run.design import Design
from sdt_drake.run.kinds import CONTROLLERS, Kind

SHIPPED: dict[str, type[Controller]] = {
    "pi": Pi,
    "pi_ctc": PiCtc,
    "pi_id": PiId,
    "p_pi": PPi,
    "pi_scheduled": PiScheduled,
    "inverse_dynamics": InverseDynamics,
}
"""Classes of the shipped controllers by kind."""


def controller_class(kind: str) -> type[Controller]:
    """Return the class of a kind of controller."""
    return cast(type[Controller], CONTROLLERS[kind].controller or SHIPPED[kind])


def make_controller(design: Design) -> tuple[type, System]:
    """Return class and system of the controller of a design's scenario.

    Raises:
        InputError: if a controller of your own fails.
    """
    controller = controller_class(design.scenario.controller.kind)
    with own_code(design, controller):
        if issubclass(controller, Shipped):
            return controller, controller.diagram(design)
        # Registered classes derive from both, and their constructor takes a design.
        return controller, cast("Callable[[Design], System]", controller)(design)


def in_errors(design: Design, controller: type) -> str:
    """Return the name of a controller in error messages: its kind, if it has one, and its class."""
    if controller is PassThrough:  # an input of the loop
        return "external controller"
    kind = design.scenario.controller.kind
    name = f" '{kind}'" if controller_class(kind) is controller else ""
    return f"controller{name} (class {controller.__name__})"


@contextmanager
def own_code(design: Design, controller: type) -> Iterator[None]:
    """Attribute errors raised by your own controller, SystemExit included, to that controller."""
    try:
        yield
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        if controller in (*SHIPPED.values(), PassThrough):
            raise
        text = f"{type(error).__name__}: {one_line(error)}"
        raise InputError(f"{in_errors(design, controller)}: fails ({text})") from error


def register_controller(name: str, controller: type[Controller]) -> None:
    """Register your own controller for scenarios, comparisons and studies.

    Args:
        name: its `controller.kind` in scenarios: letters, digits and _.
        controller: a class that derives from a Drake system and from `Controller`, or from a
            shipped controller.

    Raises:
        InputError: for a name that is shipped or no name, a class that is no `Controller`, or
            one that declares ports before the constructor of its Drake system has run.

    Examples:
        >>> from sdt_drake.run.controllers import Pi, register_controller
        >>> from sdt_drake.run.kinds import CONTROLLERS
        >>> class Stiff(Pi):
        ...     needs = ("largest inertia of each joint",)
        >>> register_controller("stiff", Stiff)
        >>> CONTROLLERS["stiff"].needs
        ('largest inertia of each joint',)
    """
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z]\w*", name):
        raise InputError(f"controller {name!r}: expected a name of letters, digits and _")
    if name in SHIPPED:
        raise InputError(f"controller '{name}': ships with the package, expected another name")
    is_class = isinstance(controller, type) and issubclass(controller, Controller)
    if not (is_class and issubclass(controller, (System, Shipped))):
        raise InputError(
            f"controller '{name}': {controller!r}, expected a class that derives from a Drake "
            "system and from sdt_drake.run.controllers.Controller, or from a shipped controller"
        )
    for one in controller.__mro__:
        if issubclass(one, System) and _declares_first(one):
            raise InputError(
                f"controller '{name}' (class {controller.__name__}): __init__ of {one.__name__} "
                "declares ports first, expected super().__init__() before"
            )
    of_class = {x.name: getattr(controller, x.name) for x in fields(Kind) if x.name != "controller"}
    CONTROLLERS[name] = Kind(**of_class, controller=controller)


def _declares_first(system: type) -> bool:
    """Return whether a class declares ports, or is built, before any __init__ of its bases.

    Drake would write to uninitialised memory. Python lists the names in code by their first use.
    """
    own = inspect.unwrap(vars(system).get("__init__", object))
    names = own.__code__.co_names if inspect.isfunction(own) else ()  # Drake's are in C++
    before = takewhile("__init__".__ne__, names)
    return any(name.startswith(("Declare", "BuildInto")) for name in before)


__all__ = [
    "SHIPPED", "Controller", "InverseDynamics", "PPi", "Pi", "PiCtc", "PiId",
    "PiScheduled", "controller_class", "in_errors", "make_controller", "own_code",
    "register_controller", "start_controller",
]  # fmt: skip
