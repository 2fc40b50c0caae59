"""What the fields of a file's dataclasses take, and the one check of it.

A dataclass states its rules in the fields, so that files, objects made in Python and a reference
of all fields go by the same ones:

    @dataclass(slots=True)
    class Drive:
        '''Attributes:
            period: sampling period of the speed loop.
        '''

        period: Optional[float] = setting(None, above=0, unit="s")
        n1: Optional[list[float]] = setting(None, above=0, per_joint=True, unit="rad/s")

        def problems(self):  # rules between fields; only asked where each field is right
            if self.n1 is not None and self.period is None:
                yield "n1", "needs period"

What a field means stands in the docstring alone, its unit and side in `setting` alone;
`schema` makes the reference and the JSON Schema of a file of both.

Drake's typed YAML takes such a class, too, if all fields have defaults; it needs real annotations
(no `from __future__ import annotations`) and Optional[...] or Union[...] in full.
"""

import contextlib
import dataclasses
import difflib
import functools
import math
import re
import types
import typing
from collections.abc import Collection, Iterable, Iterator
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Any, Optional, TypeVar, cast

import numpy as np

from sdt_drake.io.errors import InputError, Problem, dotted
from sdt_drake.io.resources import beside

T = TypeVar("T")

Problems = Iterator[tuple[str, str]]
"""What is wrong between fields of an object: the dotted name of one, and what would be right."""

_LONGEST = 60  # letters of a value that is told


# --- rules -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Rule:
    """What a field takes, beside its type; of a list, what every number or text in it is.

    Attributes:
        above, minimum, maximum, below: bounds of numbers, without and with the bound itself.
        choices: texts, of which it takes one.
        more_by: a field beside it; where that is given, it takes other texts, too.
        per_joint: a list with one value for each joint of the robot.
        count: how many values a list has.
        empty: "" or [] has a meaning; it always has where it is the default.
        file: of a text that names a file: its kind, of `sdt_drake.io.resources.SHIPPED` where some
            ship; relative paths start in the folder of the YAML file.
        unit: of numbers; "-" for shares, factors and counts.
        side: "joint" or "motor", where that makes a difference.
    """

    above: float = -math.inf
    minimum: float = -math.inf
    maximum: float = math.inf
    below: float = math.inf
    choices: Collection[str] = ()
    more_by: str = ""
    per_joint: bool = False
    count: Optional[int] = None
    empty: bool = False
    file: str = ""
    unit: str = ""
    side: str = ""

    def takes(self, number: float) -> bool:
        """Whether a number is finite and within the bounds."""
        within = self.minimum <= number <= self.maximum and self.above < number < self.below
        return within and (isinstance(number, int) or math.isfinite(number))

    def bounds(self) -> str:
        """The bounds for people: " > 0 and <= 1 [s]"."""
        limits = {">": self.above, ">=": self.minimum, "<=": self.maximum, "<": self.below}
        told = [f"{sign} {limit:.12g}" for sign, limit in limits.items() if math.isfinite(limit)]
        unit = f" [{self.unit}]" if self.unit not in ("", "-") else ""
        return (f" {' and '.join(told)}" if told else "") + unit


def setting(default: Any = MISSING, **rule: Any) -> Any:
    """A field with a `Rule`: must be given if it has no default; a dataclass makes its own."""
    metadata = {"rule": Rule(**rule)}
    if isinstance(default, type):
        return dataclasses.field(default_factory=default, metadata=metadata)
    if isinstance(default, list):
        return dataclasses.field(default_factory=lambda: list(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


# --- the check -------------------------------------------------------------------------------


def check(thing: object, where: str = "", n: int | None = None) -> None:
    """Hold an object made in Python against the rules of its dataclass.

    Args:
        thing: an instance of a dataclass.
        where: what errors start with.
        n: number of joints of the robot; lists for each joint may have any length without it.

    Raises:
        InputError: with a line for each problem: field, value, and what would be right.
    """
    walk = _Walk(n, None)
    walk.part([type(thing)], thing, "")
    walk.end(where)


def made(schema: type[T], data: Any, file: Path, changed: Collection[str] = ()) -> T:
    """The object of a dataclass that the content of a YAML file describes.

    Args:
        schema: the dataclass.
        data: the content.
        file: gives the folder that relative paths start from.
        changed: dotted names of what does not stand in the file: relative paths there start from
            the working directory.

    Raises:
        InputError: as `check`, and for fields that there are none of, or that are missing.
    """
    walk = _Walk(None, file.resolve().parent, changed)
    thing = walk.part([schema], data, "")
    walk.end(str(file))
    return cast(T, thing)


def given(thing: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted names and values of all fields of an object that are not as by default."""
    for field in _fields(thing):
        value = _plain(getattr(thing, field.name))
        if dataclasses.is_dataclass(value):
            yield from given(value, f"{prefix}{field.name}.")
        elif value != default_of(field):
            yield prefix + field.name, value


def is_within(name: str, field: str) -> bool:
    """Whether a dotted name is that of a field, or of a part or an entry of it."""
    return re.match(rf"{re.escape(field)}(?![^.[])", name) is not None


def unknown(place: str, name: str, known: Collection[str]) -> Problem:
    """The problem of a name that no field has."""
    near = tuple(difflib.get_close_matches(name, known, n=3))
    return Problem("no such field", f"one of {', '.join(known)}", place, near=near)


def suggestion(name: str, known: Iterable[str], otherwise: str = "") -> str:
    """The known name that is like a wrong one, for people: "did you mean 'kind'?"; or else
    `otherwise`, by default all that is known."""
    known = list(known)
    near = difflib.get_close_matches(name, known, n=3)
    if near:
        return f"did you mean {' or '.join(map(repr, near))}?"
    return otherwise or f"expected one of {', '.join(known)}"


class _Walk:
    """A way through plain data or objects that collects what is wrong."""

    def __init__(self, n: int | None, folder: Path | None, changed: Collection[str] = ()):
        self.n, self.folder, self.changed = n, folder, changed
        self.wrong: list[Problem] = []

    def end(self, where: str) -> None:
        if self.wrong:
            raise InputError(*(problem._replace(where=where) for problem in self.wrong))

    def refuse(self, name: str, value: Any, expected: str) -> None:
        self.wrong.append(Problem(_told(value), expected, place=name))

    def say(self, name: str, text: str) -> None:
        self.wrong.append(Problem(text, place=name))

    def part(self, options: list[type], given: Any, name: str) -> Any:
        """One of several dataclasses, from its fields by name; the first one without a tag."""
        schema: type | None
        if type(given) in options:
            schema, data = type(given), {f.name: getattr(given, f.name) for f in _fields(given)}
        else:
            data = {} if given is None and name and self.folder is not None else given
            schema = self.tagged(options, data, name)
        if schema is None:
            return None
        known = {field.name: field for field in _fields(schema)}
        before = len(self.wrong)
        for key in data:
            if key not in known and key != "_tag":
                self.wrong.append(unknown(dotted(name, key), key, known))
        values = {}
        for key, field in known.items():
            inner = dotted(name, key)
            if key in data:
                values[key] = self.field(hints_of(schema)[key], field, data[key], inner)
            elif default_of(field) is MISSING:
                self.say(
                    inner, f"missing, expected {expected(hints_of(schema)[key], rule_of(field))}"
                )
        if len(self.wrong) > before:
            return None
        thing = given if type(given) is schema else schema(**values)
        self.ask(thing, name)
        return thing

    def ask(self, thing: Any, name: str) -> None:
        """For the rules between fields."""
        try:
            for field, text in getattr(thing, "problems", tuple)():
                self.say(dotted(name, field), text)
        except InputError as error:
            self.wrong += [x._replace(place=dotted(name, x.place)) for x in error.problems]

    def tagged(self, options: list[type], data: Any, name: str) -> type | None:
        """The dataclass that the YAML tag (`!Name`) chooses."""
        if self.folder is None:
            self.refuse(name, data, f"a {options[0].__name__}")
            return None
        if not isinstance(data, dict):
            fields = ", ".join(field.name for field in _fields(options[0]))
            self.refuse(name, data, f"a mapping with {fields}")
            return None
        by_tag = {f"!{option.__name__}": option for option in options}
        tag = data.get("_tag", f"!{options[0].__name__}")
        if tag not in by_tag:
            self.say(name, f"unknown kind {tag}, expected {', '.join(by_tag)}")
        return by_tag.get(tag)

    def field(self, hint: Any, field: dataclasses.Field[Any], data: Any, name: str) -> Any:
        rule = rule_of(field)
        data = _plain(data)
        default = default_of(field)
        if data in ("", []) and data != default and not rule.empty:
            return self.refuse(name, data, expected(hint, rule))
        if isinstance(data, list) and data:
            joints = self.n if rule.per_joint else None
            count = rule.count or joints
            if count is not None and len(data) != count:
                each = ", one for each joint" if joints else ""
                self.say(name, f"{len(data)} value(s), expected {count}{each}")
        return self.value(hint, rule, data, name)

    def value(self, hint: Any, rule: Rule, data: Any, name: str) -> Any:
        options = options_of(hint)
        if data is None and type(None) in options:
            return None
        if dataclasses.is_dataclass(options[0]):
            return self.part([o for o in options if o is not type(None)], data, name)
        data = _plain(data)
        if typing.get_origin(options[0]) is list:
            if not isinstance(data, list):
                return self.refuse(name, data, expected(hint, rule))
            item = typing.get_args(options[0])[0]
            return [self.value(item, rule, x, f"{name}[{i + 1}]") for i, x in enumerate(data)]
        if options[0] is float:
            return self.number(rule, data, name)
        if type(data) is not options[0] or not _is_taken(rule, data):
            self.refuse(name, data, expected(hint, rule))
        if rule.file and self.folder is not None and type(data) is str:
            is_changed = any(is_within(name, x) for x in self.changed)
            try:
                return beside(data, Path.cwd() if is_changed else self.folder, rule.file)
            except InputError as error:
                self.say(name, str(error))
        return data

    def number(self, rule: Rule, data: Any, name: str) -> float:
        # A text of a file, too: YAML 1.1 takes 1e3 for one, Drake for a number.
        takes = (int, float) if self.folder is None else (int, float, str)
        number = math.nan
        if isinstance(data, takes) and not isinstance(data, bool):
            with contextlib.suppress(ValueError, OverflowError):
                number = float(data)
        if not rule.takes(number):
            finite = "finite " if isinstance(data, float) and not math.isfinite(data) else ""
            self.refuse(name, data, f"a {finite}number{rule.bounds()}")
        return number


def _plain(data: Any) -> Any:
    """Python's own numbers and lists for those of numpy."""
    if isinstance(data, np.ndarray | np.generic):
        return data.tolist()
    return list(data) if isinstance(data, tuple) else data


def _told(value: Any) -> str:
    if value in (None, "", []):
        return "empty"
    if isinstance(value, int) and abs(value) >= 2**64:
        return "a whole number of more than 64 bits"
    text = repr(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _is_taken(rule: Rule, data: int | bool | str) -> bool:
    if isinstance(data, str):
        return not rule.choices or bool(rule.more_by) or data in rule.choices
    return isinstance(data, bool) or rule.takes(data)


def expected(hint: Any, rule: Rule) -> str:
    """What a field of a type takes, for people."""
    schema = options_of(hint)[0]
    if rule.choices:
        few = "some" if typing.get_origin(schema) is list else "one"
        return f"{few} of {', '.join(rule.choices)}"
    if kinds := _kinds(hint):
        return kinds.replace("mappings", "a mapping")
    if typing.get_origin(schema) is list:
        item = typing.get_args(schema)[0]
        plural = {float: f"numbers{rule.bounds()}", str: "texts"}.get(item, _kinds(item) or "lists")
        return f"a list of {plural}" + (", one for each joint" if rule.per_joint else "")
    if schema in (int, float):
        return f"a {'whole ' if schema is int else ''}number{rule.bounds()}"
    return "true or false" if schema is bool else "a text"


def _kinds(hint: Any) -> str:
    """The tags of several dataclasses."""
    tags = [f"!{schema.__name__}" for schema in dataclasses_of(hint)]
    return ", ".join(tags) if len(tags) > 1 else "mappings" * len(tags)


def dataclasses_of(hint: Any) -> list[type]:
    """The members of a union that are dataclasses."""
    return [o for o in options_of(hint) if isinstance(o, type) and dataclasses.is_dataclass(o)]


def rule_of(field: dataclasses.Field[Any]) -> Rule:
    """The rule of a field; one that takes everything where none was set."""
    return cast(Rule, field.metadata.get("rule", Rule()))


def default_of(field: dataclasses.Field[Any]) -> Any:
    """The default of a field; MISSING where it must be given."""
    return field.default if field.default_factory is MISSING else field.default_factory()


def options_of(hint: Any) -> list[Any]:
    """The members of a union, what is not None first."""
    is_union = typing.get_origin(hint) in (typing.Union, types.UnionType)
    return sorted(typing.get_args(hint), key=lambda o: o is type(None)) if is_union else [hint]


hints_of = functools.cache(typing.get_type_hints)
"""Types of the fields of a dataclass, by name."""

_fields = dataclasses.fields
