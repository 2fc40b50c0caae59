"""Controllers by their kind, shipped and your own, and registration of your own."""

import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, make_dataclass
from itertools import takewhile
from typing import Any, ClassVar, Literal

from pydrake.systems.framework import Context, System

from sdt_drake.io.arrays import Array
from sdt_drake.io.deprecated import renamed
from sdt_drake.io.errors import InputError
from sdt_drake.io.schema import schema_of
from sdt_drake.motion import Motion
from sdt_drake.run.controllers.base import Controller, start_own
from sdt_drake.run.controllers.inverse_dynamics import InverseDynamics
from sdt_drake.run.controllers.p_pi import PositionGain, PPi
from sdt_drake.run.controllers.pi import Pi, PiCtc, PiId
from sdt_drake.run.controllers.pi_dob import PiDob
from sdt_drake.run.controllers.pi_scheduled import PiScheduled
from sdt_drake.run.design import Design
from sdt_drake.run.options import CONTROLLERS, AntiWindup, ChosenFeedforward, ControllerOptions

SHIPPED: Mapping[str, type[ControllerOptions]] = {
    x.kind: x for x in (Pi, PiCtc, PiId, PiDob, PPi, PiScheduled, InverseDynamics)
}
"""Options of the shipped controllers by kind."""

CONTROLLERS.update(SHIPPED)


@dataclass(frozen=True)
class Own(ControllerOptions):
    """Options of a controller of your own, which a class or a function makes from a design."""

    made_by: ClassVar[Any]
    """The class, or the function `design -> System`."""

    def feedback(self, design: Design) -> System:
        return self.made_by(design)

    def linear(self, design: Design, sample: int) -> System:
        return getattr(self.made_by, "linear", super().linear)(design, sample)

    def start(
        self, system: System, context: Context, design: Design, tau: Array, start: Motion | None
    ) -> None:
        start_own(system, context, tau, start)

    def in_words(self, design: Design) -> str:
        return getattr(self.made_by, "in_words", super().in_words)(design)

    @property
    def title(self) -> str:
        return self.made_by.__name__

    @property
    def feedforward_in_use(self) -> str:
        own = super().feedforward_in_use
        return getattr(self.made_by, "feedforward", "none") if own == "none" else own

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self.kind, vars(self))


def _unpickled(kind: str, values: Mapping[str, Any]) -> ControllerOptions:
    """Make options of your own in another process, which may register the controller later."""
    options: Any = CONTROLLERS.get(kind)
    if options is None:
        own = [(x, Any, None) for x in values.keys() - {x.name for x in fields(ControllerOptions)}]
        options = make_dataclass("Unregistered", own, bases=(ControllerOptions,), frozen=True)
    made: ControllerOptions = object.__new__(options)
    vars(made).update(values)
    return made


def register_controller(
    name: str,
    controller: type[Controller] | Callable[[Design], System],
    options: type[ControllerOptions] = ControllerOptions,
) -> None:
    """Register your own controller for scenarios, comparisons and studies.

    Args:
        name: its `controller.kind` in scenarios: letters, digits and _.
        controller: a class that derives from a Drake system and from `Controller`, or a function
            that makes a Drake system from a `Design`. Ports are as in `Controller`.
        options: a frozen dataclass that derives from `ControllerOptions`. Its fields stand under
            `controller` in scenarios. All need defaults. The options of all controllers by default.

    Raises:
        InputError: for a name that is shipped or no name, no class or function of that sort, or a
            class that declares ports before the constructor of its Drake system has run.

    Examples:
        >>> from sdt_drake.run.controllers import CONTROLLERS, register_controller
        >>> from sdt_drake.systems import pi_speed_controller
        >>> def half(design):
        ...     r = design.device.simulated.gear_ratio
        ...     gains = design.tuning.gains
        ...     return pi_speed_controller(gains=gains, gear_ratio=r, setpoint_weight=0.5)
        >>> register_controller("half", half)
        >>> CONTROLLERS["half"](omega_r=66.0).label
        'half'
    """
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z]\w*", name):
        raise InputError(f"controller {name!r}: expected a name of letters, digits and _")
    if name in SHIPPED:
        raise InputError(f"controller '{name}': ships with the package, expected another name")
    if isinstance(controller, type):
        _check_class(name, controller)
    elif not callable(controller):
        raise InputError(f"controller '{name}': {controller!r}, expected a class or a function")
    if not (isinstance(options, type) and issubclass(options, ControllerOptions)):
        raise InputError(
            f"controller '{name}': options {options!r}, expected a class that derives from "
            "sdt_drake.ControllerOptions"
        )
    about = {x: getattr(controller, x) for x in _OF_CLASSES if hasattr(controller, x)}
    old = tuple(_OLD_OPTIONS[option] for option in getattr(controller, "options", ()))
    if old:
        classes = ", ".join(option.__name__ for option in old)
        new = f"options= a class that derives from {classes}"
        renamed(f"controller '{name}': the attribute options", new)
    values = about | {
        "made_by": staticmethod(controller),
        "kind": name,
        "__annotations__": {"kind": Literal[name]},
        "__module__": controller.__module__,
        "__doc__": inspect.getdoc(controller),
    }
    made: Any = dataclass(frozen=True)(type(controller.__name__, (Own, *old, options), values))
    made()  # options without defaults are refused
    CONTROLLERS[name] = made
    schema_of.cache_clear()  # it lists the fields of all kinds


_OF_CLASSES = ("needs", "plants", "takes_feedforward")
"""Attributes of a controller class that replace those of its options."""

_OLD_OPTIONS = {
    "anti_windup": AntiWindup, "feedforward": ChosenFeedforward, "position_gain": PositionGain,
}  # fmt: skip
"""Options that a class of version 0.4 lists in its attribute `options`."""


def _check_class(name: str, controller: type) -> None:
    """Check that a class makes a Drake system with the methods of `Controller`.

    Raises:
        InputError: if it does not, or declares ports too early.
    """
    if not issubclass(controller, Controller) or not issubclass(controller, System):
        raise InputError(
            f"controller '{name}': {controller!r}, expected a class that derives from a Drake "
            "system and from sdt_drake.run.controllers.Controller, or a function"
        )
    for one in controller.__mro__:
        if issubclass(one, System) and _declares_first(one):
            raise InputError(
                f"controller '{name}' (class {controller.__name__}): __init__ of {one.__name__} "
                "declares ports first, expected super().__init__() before"
            )


def _declares_first(system: type) -> bool:
    """Return whether a class declares ports, or is built, before any __init__ of its bases.

    Drake would write to uninitialised memory. Python lists the names in code by their first use.
    """
    own = inspect.unwrap(vars(system).get("__init__", object))
    names = own.__code__.co_names if inspect.isfunction(own) else ()  # Drake's are in C++
    before = takewhile("__init__".__ne__, names)
    return any(name.startswith(("Declare", "BuildInto")) for name in before)
