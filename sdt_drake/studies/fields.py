"""Fields of a scenario by dotted name, such as "plant.friction.coulomb[2]"."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sdt_drake.io.errors import PART, InputError, is_within
from sdt_drake.io.fields import suggestion
from sdt_drake.io.schema import inner, parts, schema_of
from sdt_drake.run.scenario import ControllerChoice, Scenario

Value = float | str

_TYPES = {"number": float, "boolean": bool, "string": str}


@dataclass(frozen=True)
class Field:
    """A field of a scenario, or one entry of a list in it."""

    name: str
    """Dotted name; entries of lists are counted from 1: "controller.kp[2]"."""
    parts: tuple[str, ...]
    """Names of the attributes from the scenario to the field."""
    entry: int | None
    """Index of the entry in the list, from 0; None for the whole field."""
    type: type
    """Type of a value: float, bool or str; ControllerChoice for the field "controller", whose
    values are controller labels ("p_pi+id")."""
    many: bool
    """True for a list, in which every entry gets the value."""
    file: str
    """Kind of the file that the field names; "" if it names none."""

    @property
    def touched(self) -> list[Field]:
        """The fields that change with this one: kind and feedforward for a controller label."""
        if self.type is ControllerChoice:
            return [find_field(f"{self.name}.{part}") for part in ("kind", "feedforward")]
        return [self]

    def get(self, scenario: Scenario) -> Any:
        """Return the scenario's value of the field; the whole list for an entry of one."""
        return getattr(self._owner(scenario), self.parts[-1])

    def put(self, scenario: Scenario, value: Value, apply: str = "value") -> None:
        """Set the field to a value, multiply it by the value ("factor"), or add it ("offset").

        In a list, every entry is changed.

        Raises:
            InputError: if the scenario has no such list or entry, or no number to scale or shift.
        """
        old = self.get(scenario)
        if self.entry is None and not self.many:
            setattr(self._owner(scenario), self.parts[-1], self._changed(old, value, apply))
            return
        if not old:
            raise InputError("empty in the base scenario; add the list there", place=self.name)
        if self.entry is not None and self.entry >= len(old):
            raise InputError(
                f"the base scenario's list has {len(old)} value(s), expected an entry of it",
                place=self.name,
            )
        for i in range(len(old)) if self.many else [self.entry]:
            old[i] = self._changed(old[i], value, apply)

    def _changed(self, old: Any, value: Value, apply: str) -> Value:
        if apply == "value":
            return value
        if old is None:
            raise InputError(
                f"no value in the base scenario to apply a {apply} to; add it there",
                place=self.name,
            )
        return old * value if apply == "factor" else old + value

    def _owner(self, scenario: Scenario) -> Any:
        return functools.reduce(getattr, self.parts[:-1], scenario)


@functools.cache
def find_field(name: str) -> Field:
    """Return the field of a dotted name.

    Raises:
        InputError: for an unknown name (with similar ones), or the name of a group of fields.
    """
    top = node = schema_of(Scenario)
    attributes: list[str] = []
    entry, many = None, False
    for part in name.split("."):
        match = PART.fullmatch(part)
        if match is None or entry is not None or match[1] not in node.get("properties", ()):
            raise _unknown(name)
        attributes.append(match[1])
        node = inner(node["properties"][match[1]], top)
        many = "items" in node
        if match[2] is not None:
            if not many:
                raise InputError(
                    f"{match[1]} is not a list, expected it without [{match[2]}]", place=name
                )
            entry, many = int(match[2]) - 1, False
    if "properties" in node and name != "controller":
        fields = ", ".join(f"{name}.{field}" for field in node["properties"])
        raise InputError(f"a group of fields, expected one of {fields}", place=name)
    kind = ControllerChoice if name == "controller" else _TYPES[node.get("items", node)["type"]]
    return Field(name, tuple(attributes), entry, kind, many, node.get("file", ""))


def check_changes(changes: Iterable[str], own: Iterable[str], file: Path) -> None:
    """Raise InputError if the study would override a change of its base scenario.

    Args:
        changes: names of the fields to change.
        own: names of the fields, or entries, that the study sets itself.
        file: file of the study.

    Raises:
        InputError: naming the field.
    """
    for name in changes:
        for field in own:
            if is_within(name, field):
                raise InputError(f"{file} sets {field} itself; change it in that file", place=name)


@functools.cache
def field_names() -> tuple[str, ...]:
    """Return the dotted names of all fields of a scenario; lists without their entries."""
    entries = (entry for part in parts(Scenario) for entry in part.entries)
    return tuple(entry.name for entry in entries if entry.takes != "a mapping")


def _unknown(name: str) -> InputError:
    known = [*field_names(), "controller"]
    bare = name.partition("[")[0]
    elsewhere = [field for field in known if field.rpartition(".")[2] == bare.rpartition(".")[2]]
    return InputError(
        f"not a field of a scenario, {suggestion(bare, elsewhere or known)}", place=name
    )
