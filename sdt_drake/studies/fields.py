"""Fields of a scenario by their dotted names: "plant.friction.coulomb[2]"."""

from __future__ import annotations

import dataclasses
import difflib
import functools
import re
import types
import typing
from dataclasses import dataclass
from typing import Any

from sdt_drake.errors import InputError
from sdt_drake.scenario import ControllerChoice, Scenario

Value = float | str

_PART = re.compile(r"(\w+)(?:\[(\d{1,6})\])?")


@dataclass(frozen=True)
class Field:
    """A field of a scenario, or one entry of a list there.

    Attributes:
        name: dotted, entries counted from 1: "controller.kp[2]".
        parts: attributes from the scenario down.
        entry: of the list, from 0; None for the whole field.
        type: of what a value must be: float, int, bool or str; ControllerChoice for the field
            "controller", whose values are labels of controllers ("p_pi+id").
        many: whether the field is a list, all of whose entries get the value.
    """

    name: str
    parts: tuple[str, ...]
    entry: int | None
    type: type
    many: bool

    @property
    def touched(self) -> list[Field]:
        """The fields that get another value: several for the label of a controller."""
        if self.type is ControllerChoice:
            return [find_field(f"{self.name}.{part}") for part in ("kind", "feedforward")]
        return [self]

    def get(self, scenario: Scenario) -> Any:
        """What the scenario has there.

        Raises:
            InputError: if the scenario has no such entry.
        """
        value = getattr(self._owner(scenario), self.parts[-1])
        return value if self.entry is None else self._list(value)[self.entry]

    def set(self, scenario: Scenario, value: Any) -> None:
        """Put a value there; a list gets it in every entry.

        Raises:
            InputError: if the scenario has no such list or entry.
        """
        owner, last = self._owner(scenario), self.parts[-1]
        if self.entry is not None:
            self._list(getattr(owner, last))[self.entry] = value
        elif self.many:
            setattr(owner, last, [value] * len(self._list(getattr(owner, last))))
        else:
            setattr(owner, last, value)

    def change(self, scenario: Scenario, how: str, by: float) -> None:
        """Multiply what is there ("factor"), or add to it ("offset"); a list entry by entry.

        Raises:
            InputError: if there is nothing to change.
        """
        old = self.get(scenario)
        if old is None:
            raise InputError(f"{self.name}: the base scenario has no value for a {how}; give it")

        def changed(x: float) -> float:
            return x * by if how == "factor" else x + by

        if self.many:
            setattr(self._owner(scenario), self.parts[-1], [changed(x) for x in old])
        else:
            self.set(scenario, changed(old))

    def _owner(self, scenario: Scenario) -> Any:
        owner: Any = scenario
        for part in self.parts[:-1]:
            owner = getattr(owner, part)
        return owner

    def _list(self, value: list | None) -> list:
        if not value:
            raise InputError(f"{self.name}: the base scenario has no such list; add it there")
        if self.entry is not None and self.entry >= len(value):
            raise InputError(f"{self.name}: the base scenario has {len(value)} value(s) there")
        return value


@functools.cache
def find_field(name: str) -> Field:
    """The field of a dotted name.

    Raises:
        InputError: for a name that no scenario has, with near ones; for a part instead of a field.
    """
    schema: Any = Scenario
    attributes: list[str] = []
    entry, many = None, False
    for part in name.split("."):
        match = _PART.fullmatch(part)
        if match is None or not dataclasses.is_dataclass(schema) or entry is not None:
            raise _unknown(name)
        attribute, number = match[1], match[2]
        hints = typing.get_type_hints(schema)
        if attribute not in hints:
            raise _unknown(name)
        attributes.append(attribute)
        schema = _plain(hints[attribute])
        many = typing.get_origin(schema) is list
        if many:
            schema = _plain(typing.get_args(schema)[0])
        if number is not None:
            if not many or int(number) == 0:
                raise InputError(f"{name}: {part} is no entry of a list, counted from 1")
            entry, many = int(number) - 1, False
    if dataclasses.is_dataclass(schema) and schema is not ControllerChoice:
        fields = ", ".join(f"{name}.{field}" for field in typing.get_type_hints(schema))
        raise InputError(f"{name}: is a part, not a field, expected one of {fields}")
    return Field(name, tuple(attributes), entry, schema, many)


def field_names(schema: Any = Scenario, prefix: str = "") -> list[str]:
    """Dotted names of all fields, lists without their entries."""
    names = []
    for field, hint in typing.get_type_hints(schema).items():
        plain = _plain(hint)
        if dataclasses.is_dataclass(plain):
            names += field_names(plain, f"{prefix}{field}.")
        else:
            names.append(prefix + field)
    return names


def _plain(hint: Any) -> Any:
    """The type without "or None"."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return next(a for a in typing.get_args(hint) if a is not type(None))
    return hint


def _unknown(name: str) -> InputError:
    known = [*field_names(), "controller"]
    bare = re.sub(r"\[\d*\]", "", name)
    last = bare.rpartition(".")[2]
    near = [n for n in known if n.rpartition(".")[2] == last]  # right, but at another place
    near += [n for n in difflib.get_close_matches(bare, known, n=3) if n not in near]
    meant = f"did you mean {' or '.join(near[:3])}?"
    hint = meant if near else f"expected one of {', '.join(known)}"
    return InputError(f"{name}: no field of a scenario, {hint}")
