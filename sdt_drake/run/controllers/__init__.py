"""The controllers as Drake systems: the class of each kind, and controllers of one's own."""

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
from sdt_drake.run.controllers.base import Controller
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
"""The classes of the controllers that ship with the package, by their kinds."""


def controller_class(kind: str) -> type[Controller]:
    """Return the class of a kind of controller."""
    return cast(type[Controller], CONTROLLERS[kind].controller or SHIPPED[kind])


def make_controller(design: Design) -> System:
    """The scenario's controller.

    Raises:
        InputError: if one that does not ship with the package fails.
    """
    controller = controller_class(design.scenario.controller.kind)
    with own_code(design, controller):
        # Registered classes derive from both, and are made with a design.
        return cast("Callable[[Design], System]", controller)(design)


def tells_updates(controller: System) -> bool:
    """Whether a controller tells its command just after updates; a class of one's own that derives
    from one that does may have another law, and tells nothing."""
    own: type = type(controller)
    return own in SHIPPED.values() or "after_updates" in vars(own)


def in_errors(design: Design, controller: type) -> str:
    """The name of a controller of that class in errors: that of its kind, if it has one, and its
    class."""
    if controller is PassThrough:  # the input of the loop for one
        return "external controller"
    kind = design.scenario.controller.kind
    name = f" '{kind}'" if controller_class(kind) is controller else ""
    return f"controller{name} (class {controller.__name__})"


@contextmanager
def own_code(design: Design, controller: type) -> Iterator[None]:
    """Say that an error is one of a controller of that class, if it does not ship with the package;
    SystemExit is such an error, too."""
    try:
        yield
    except InputError:
        raise
    except (Exception, SystemExit) as error:  # of a controller
        if controller in (*SHIPPED.values(), PassThrough):
            raise
        text = f"{type(error).__name__}: {one_line(error)}"
        raise InputError(f"{in_errors(design, controller)}: fails ({text})") from error


def register_controller(name: str, controller: type[Controller]) -> None:
    """Make a controller of one's own known to scenarios, comparisons and studies, by its name.

    Raises:
        InputError: for the name of a shipped one or no name, a class that is no `Controller`, or
            one that declares ports before the constructor of its Drake system has run.
    """
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z]\w*", name):
        raise InputError(f"controller {name!r}: expected a name of letters, digits and _")
    if name in SHIPPED:
        raise InputError(f"controller '{name}': ships with the package, expected another name")
    is_class = isinstance(controller, type)
    if not (is_class and issubclass(controller, Controller) and issubclass(controller, System)):
        raise InputError(
            f"controller '{name}': {controller!r}, expected a class that derives from a Drake "
            "system and from sdt_drake.run.controllers.Controller"
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
    """Whether a class declares ports, or is built, before any __init__ of its bases.

    Drake would write to memory that nobody has set up. The names in code stand in the order of
    their use.
    """
    own = inspect.unwrap(vars(system).get("__init__", object))
    names = own.__code__.co_names if inspect.isfunction(own) else ()  # those of Drake are in C++
    before = takewhile("__init__".__ne__, names)
    return any(name.startswith(("Declare", "BuildInto")) for name in before)


__all__ = [
    "SHIPPED", "Controller", "InverseDynamics", "PPi", "Pi", "PiCtc", "PiId",
    "PiScheduled", "controller_class", "in_errors", "make_controller", "own_code",
    "register_controller", "tells_updates",
]  # fmt: skip
