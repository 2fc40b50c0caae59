"""Problems in the words of the command line: options in place of arguments and fields."""

import re
from collections.abc import Mapping
from inspect import BoundArguments, Parameter
from typing import Any

from sdt_drake.io.errors import InputError, Problem, is_within

_FIELDS = {
    "controller.omega_r": "omega_r",
    "controller.zeta": "zeta",
    "plant.elasticity.natural_frequency": "omega_r",
    "plant.elasticity.damping_ratio": "damping",
}
"""Arguments of commands that set fields of a scenario."""
_HINT = re.compile(r"(?<!--set )\b([a-z_]+)=(?:True|\.\.\.|(?='))")
"""An argument in a hint of a message: "with resume=True", "a lower bandwidth=...", "hold='a'"."""

_UNNAMED = re.compile("[a-z ]*")
"""Nothing, or an object that was made of arguments: "controller choice"; no file."""


def in_options(error: InputError, bound: BoundArguments) -> InputError:
    """Return an error of a command with the options that its arguments came from.

    Args:
        error: an error that the command has raised.
        bound: the arguments of the command.
    """
    options = {
        name: f"--{'set' if name == 'changes' else name.replace('_', '-')}"
        for name, parameter in bound.signature.parameters.items()
        if parameter.kind is Parameter.KEYWORD_ONLY
    }
    given = bound.arguments.get("given")
    values = bound.arguments | ({} if given is None else vars(given))
    if "given" in options:
        options |= {"changes": "--set", "trust": "--trust"}
    if "held" in options:
        options |= {"hold": "--hold", "tip": "--tip"}
    return type(error)(*(_told(one, options, values) for one in error.problems))


def _option(hint: re.Match[str], options: Mapping[str, str]) -> str:
    """Return the option of an argument in a hint, with a space before a value."""
    option = options.get(hint[1], "")
    return option + " " * hint[0].endswith("=") if option else hint[0]


def _told(problem: Problem, options: Mapping[str, str], given: Mapping[str, Any]) -> Problem:
    found, accepted = (
        _HINT.sub(lambda hint: _option(hint, options), text)
        for text in (problem.found, problem.accepted)
    )
    problem = problem._replace(found=found, accepted=accepted)
    changes = dict(given.get("changes", ()))
    fields = {name: f"--set {name}" for name in changes}
    fields |= {field: options[name] for field, name in _FIELDS.items() if given.get(name)}
    if _UNNAMED.fullmatch(problem.where):
        fields = {**options, **fields}
    for field, option in fields.items():
        if is_within(problem.place, field):
            return problem._replace(where="", place=problem.place.replace(field, option, 1))
    is_quoted = any(isinstance(x, str) and x and x in problem.found for x in changes.values())
    with_set = bool(changes) and (problem.where != "" or is_quoted)
    more = f" (with --set {', '.join(changes)})" if with_set else ""
    if problem.kind == "joints" and (robot := options.get("robot", options.get("scenario"))):
        more = f"; give the robot of the motion with {robot}"
    return problem._replace(found=f"{problem.text}{more}", accepted="") if more else problem
