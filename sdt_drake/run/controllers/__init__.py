"""The controllers, found by name in one registry."""

from __future__ import annotations

import inspect
import re
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, cast

from pydrake.systems.framework import System

from sdt_drake.io.errors import InputError, one_line, read_text
from sdt_drake.run.controllers.base import Controller
from sdt_drake.run.controllers.inverse_dynamics import InverseDynamics
from sdt_drake.run.controllers.p_pi import PPi
from sdt_drake.run.controllers.pi import Pi, PiCtc, PiId
from sdt_drake.run.controllers.pi_scheduled import PiScheduled

if TYPE_CHECKING:
    from sdt_drake.run.design import Design

CONTROLLERS: dict[str, type[Controller]] = {
    "pi": Pi,
    "pi_ctc": PiCtc,
    "pi_id": PiId,
    "p_pi": PPi,
    "pi_scheduled": PiScheduled,
    "inverse_dynamics": InverseDynamics,
}

_SHIPPED = dict(CONTROLLERS)
_LONGEST = 1_000_000  # bytes of a file of controllers
_loaded: dict[str, dict[str, type[Controller]]] = {}  # what a text has registered


def make_controller(design: Design) -> System:
    """The scenario's controller.

    Raises:
        InputError: if one that does not ship with the package fails.
    """
    controller = CONTROLLERS[design.scenario.controller.kind]
    with own_code(design, controller):
        # Registered classes derive from both, and are made with a design.
        return cast("Callable[[Design], System]", controller)(design)


def in_errors(design: Design, controller: type) -> str:
    """The name of a controller of that class in errors: that of its kind, if it has one, and its
    class."""
    kind = design.scenario.controller.kind
    name = f" '{kind}'" if CONTROLLERS[kind] is controller else ""
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
        if controller in _SHIPPED.values():
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
    if name in _SHIPPED:
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
    CONTROLLERS[name] = controller


def _declares_first(system: type) -> bool:
    """Whether a class declares ports, or is built, before any __init__ of its bases.

    Drake would write to memory that nobody has set up. The names in code stand in the order of
    their use.
    """
    code = getattr(inspect.unwrap(system.__init__), "__code__", None)  # None: in C++
    names = () if code is None else takewhile("__init__".__ne__, code.co_names)
    return any(name.startswith(("Declare", "BuildInto")) for name in names)


def load_controllers(path: str | Path) -> None:
    """Run a Python file that registers controllers of one's own; the same text only once.

    Raises:
        InputError: if there is no such file, or it fails, naming file, line and error.
    """
    file = Path(path)
    text = read_text(file, _LONGEST)
    if text in _loaded:
        CONTROLLERS.update(_loaded[text])  # another text may have taken the names
        return
    before = dict(CONTROLLERS)
    try:
        code = compile(text, str(file), "exec")
        exec(code, {"__name__": f"controllers_of_{file.stem}", "__file__": str(file)})
    except (Exception, SystemExit) as error:
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == str(file)]
        where = f"{file}, line {lines[-1]}" if lines else f"{file}"
        raise InputError(f"{where}: {type(error).__name__}: {one_line(error)}") from None
    _loaded[text] = {name: x for name, x in CONTROLLERS.items() if before.get(name) is not x}


__all__ = [
    "CONTROLLERS", "Controller", "InverseDynamics", "PPi", "Pi", "PiCtc", "PiId", "PiScheduled",
    "in_errors", "load_controllers", "make_controller", "own_code", "register_controller",
]  # fmt: skip
