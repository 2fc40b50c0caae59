"""Fields of a scenario by their dotted names: "plant.friction.coulomb[2]"."""

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
    """A field of a scenario, or one entry of a list there.

    Attributes:
        name: dotted, entries counted from 1: "controller.kp[2]".
        parts: attributes from the scenario down.
        entry: of the list, from 0; None for the whole field.
        type: of what a value must be: float, bool or str; ControllerChoice for the field
            "controller", whose values are labels of controllers ("p_pi+id").
        many: whether the field is a list, all of whose entries get the value.
        file: kind of the file that it names; "" if it names none.
    """

    name: str
    parts: tuple[str, ...]
    entry: int | None
    type: type
    many: bool
    file: str

    @property
    def touched(self) -> list[Field]:
        """The fields that get another value: several for the label of a controller."""
        if self.type is ControllerChoice:
            return [find_field(f"{self.name}.{part}") for part in ("kind", "feedforward")]
        return [self]

    def get(self, scenario: Scenario) -> Any:
        """What the scenario has in the field; of a list, all entries."""
        return getattr(self._owner(scenario), self.parts[-1])

    def put(self, scenario: Scenario, value: Value, apply: str = "value") -> None:
        """Put a value into the field, or multiply what is there by it ("factor"), or add it
        ("offset").

        A list gets it in every entry.

        Raises:
            InputError: if the scenario has no such list or entry, or nothing to change.
        """
        old = self.get(scenario)
        if self.entry is None and not self.many:
            setattr(self._owner(scenario), self.parts[-1], self._changed(old, value, apply))
            return
        if not old:
            raise InputError("the base scenario has no such list; add it there", place=self.name)
        if self.entry is not None and self.entry >= len(old):
            raise InputError(f"the base scenario has {len(old)} value(s) there", place=self.name)
        for i in range(len(old)) if self.many else [self.entry]:
            old[i] = self._changed(old[i], value, apply)

    def _changed(self, old: Any, value: Value, apply: str) -> Value:
        if apply == "value":
            return value
        if old is None:
            raise InputError(
                f"the base scenario has no value for a {apply}; give it", place=self.name
            )
        return old * value if apply == "factor" else old + value

    def _owner(self, scenario: Scenario) -> Any:
        return functools.reduce(getattr, self.parts[:-1], scenario)


@functools.cache
def find_field(name: str) -> Field:
    """The field of a dotted name.

    Raises:
        InputError: for a name that no scenario has, with near ones; for a part instead of a field.
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
                raise InputError(f"{match[1]} is no list", place=name)
            entry, many = int(match[2]) - 1, False
    if "properties" in node and name != "controller":
        fields = ", ".join(f"{name}.{field}" for field in node["properties"])
        raise InputError(f"is a part, not a field, expected one of {fields}", place=name)
    kind = ControllerChoice if name == "controller" else _TYPES[node.get("items", node)["type"]]
    return Field(name, tuple(attributes), entry, kind, many, node.get("file", ""))


def check_changes(changes: Iterable[str], own: Iterable[str], file: Path) -> None:
    """Refuse changes of a base scenario that would be lost.

    Args:
        changes: names of the fields that are to have other values.
        own: names of those that the study gives values itself, whole or by entry.
        file: of the study.

    Raises:
        InputError: naming the field.
    """
    for name in changes:
        for field in own:
            if is_within(name, field):
                raise InputError(
                    f"{file} has values for {field}, expected a change there", place=name
                )


def field_names() -> list[str]:
    """Dotted names of all fields of a scenario, lists without their entries."""
    entries = (entry for part in parts(Scenario) for entry in part.entries)
    return [entry.name for entry in entries if entry.takes != "a mapping"]


def _unknown(name: str) -> InputError:
    known = [*field_names(), "controller"]
    bare = name.partition("[")[0]
    elsewhere = [field for field in known if field.rpartition(".")[2] == bare.rpartition(".")[2]]
    return InputError(f"no field of a scenario, {suggestion(bare, elsewhere or known)}", place=name)
