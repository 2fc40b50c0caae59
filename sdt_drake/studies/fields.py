"""Fields of a scenario by dotted name, such as "plant.friction.coulomb[2]"."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sdt_drake.io.errors import InputError, is_within, suggestion
from sdt_drake.io.names import parts_of, schema_at, schema_leaves, value_of
from sdt_drake.io.schema import schema_of
from sdt_drake.run.options import ControllerOptions
from sdt_drake.run.scenario import Scenario
from sdt_drake.studies.table import Value

_TYPES = {"number": float, "integer": float, "boolean": bool, "string": str}


@dataclass(frozen=True)
class Field:
    """A field of a scenario, or one entry of a list in it."""

    name: str
    """Dotted name; entries of lists are counted from 1: "controller.kp[2]"."""
    entry: int | None
    """Index of the entry in the list, from 0; None for the whole field."""
    type: type
    """Type of a value: float, bool or str; ControllerOptions for the field "controller", whose
    values are controller labels ("p_pi+id")."""
    many: bool
    """True for a list, in which every entry gets the value."""
    file: str
    """Kind of the file that the field names; "" if it names none."""
    unit: str = ""
    """Unit of a number; "" without one."""

    @property
    def touched(self) -> list[Field]:
        """The fields that change with this one: kind and feedforward for a controller label."""
        if self.type is ControllerOptions:
            return [find_field(f"{self.name}.{part}") for part in ("kind", "feedforward")]
        return [self]

    @property
    def whole(self) -> str:
        """Dotted name of the field without its entry."""
        return self.name.partition("[")[0]

    def changed(self, scenario: Scenario, value: Value, apply: str = "value") -> Any:
        """Return a value, the field multiplied by it ("factor"), or the field plus it ("offset").

        In a list, every entry is changed.

        Raises:
            InputError: if the scenario has no such list or entry, or no number to scale or shift.
        """
        old = value_of(scenario, self.whole)
        if (self.many or self.entry is not None) and not old:
            raise InputError("empty in the base scenario; add the list there", place=self.name)
        if self.many:
            return [self._changed(one, value, apply) for one in old]
        if self.entry is None:
            return self._changed(old, value, apply)
        if self.entry >= len(old):
            raise InputError(
                f"the base scenario's list has {len(old)} value(s), expected an entry of it",
                place=self.name,
            )
        return self._changed(old[self.entry], value, apply)

    def _changed(self, old: Any, value: Value, apply: str) -> Value:
        if apply == "value":
            return value
        if old is None:
            raise InputError(
                f"no value in the base scenario to apply a {apply} to; add it there",
                place=self.name,
            )
        return old * value if apply == "factor" else old + value


@functools.cache
def find_field(name: str) -> Field:
    """Return the field of a dotted name.

    Raises:
        InputError: for an unknown name (with similar ones), or the name of a group of fields.
    """
    node = schema_at(schema_of(Scenario), name)
    if node is None:
        raise _unknown(name)
    (last, entry), many = parts_of(name)[-1], "items" in node
    if entry is not None and not many:
        raise InputError(f"{last} is not a list, expected it without [{entry + 1}]", place=name)
    if "properties" in node and name != "controller":
        fields = ", ".join(f"{name}.{field}" for field in node["properties"])
        raise InputError(f"a group of fields, expected one of {fields}", place=name)
    kind = ControllerOptions if name == "controller" else _TYPES[node.get("items", node)["type"]]
    return Field(
        name, entry, kind, many and entry is None, node.get("file", ""), node.get("unit", "")
    )


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
    return tuple(name for name, _ in schema_leaves(schema_of(Scenario)))


def _unknown(name: str) -> InputError:
    known = [*field_names(), "controller"]
    bare = name.partition("[")[0]
    elsewhere = [field for field in known if field.rpartition(".")[2] == bare.rpartition(".")[2]]
    return InputError(
        f"not a field of a scenario, {suggestion(bare, elsewhere or known)}", place=name
    )
