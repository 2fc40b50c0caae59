"""Fields by dotted names, such as "controller.kp[2]", of objects, mappings and JSON Schemas."""

import dataclasses
import re
from collections.abc import Iterator, Mapping
from typing import Any

from sdt_drake.io.errors import InputError, dotted, one_line

Schema = dict[str, Any]

_PART = re.compile(r"(\w+)(?:\[([1-9]\d{0,5})\])?")


def parts_of(name: str) -> list[tuple[str, int | None]]:
    """Return the field and the entry, if any, of each part of a dotted name.

    >>> parts_of("controller.kp[2]")  # entries are counted from 1 in names, from 0 in Python
    [('controller', None), ('kp', 1)]

    Raises:
        InputError: the text is no dotted name, or a part before the last one has an entry.
    """
    matches = [_PART.fullmatch(part) for part in name.split(".")]
    if not all(matches) or any(match[2] for match in matches[:-1] if match):
        raise InputError("expected the dotted name of a field, 'controller.kind'", place=name)
    return [(match[1], int(match[2]) - 1 if match[2] else None) for match in matches if match]


# --- objects ---------------------------------------------------------------------------------


def value_of(thing: Any, name: str) -> Any:
    """Return the value of a field of an object, or of an entry of its list."""
    for field, entry in parts_of(name):
        thing = getattr(thing, field)
        thing = thing if entry is None else thing[entry]
    return thing


def given_fields(thing: Any) -> Iterator[tuple[str, Any]]:
    """Yield names and values of the fields of an object, except those left at None."""
    for field in dataclasses.fields(thing):
        value = getattr(thing, field.name)
        if value is not None or field.default is not None:
            yield field.name, value


def leaves(thing: Any, prefix: str = "") -> Iterator[tuple[str, dataclasses.Field[Any], Any]]:
    """Yield dotted name, owner's field and value of all fields of an object that are no objects."""
    for field in dataclasses.fields(thing):
        value, name = getattr(thing, field.name), f"{prefix}{field.name}"
        if dataclasses.is_dataclass(value):
            yield from leaves(value, f"{name}.")
        else:
            yield name, field, value


def given(thing: Any) -> Iterator[tuple[str, Any]]:
    """Yield dotted names and values of all fields that differ from their defaults."""
    return ((name, value) for name, field, value in leaves(thing) if value != field.default)


def put(thing: object, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of an object or a mapping, with other values by dotted names.

    Parts that change are mappings in the result; missing ones are added.

    Raises:
        InputError: a name is no dotted name, or names an entry that its list does not have.
    """
    if not isinstance(changes, Mapping) or not all(isinstance(name, str) for name in changes):
        text = "expected values by dotted names, {'controller.kind': 'p_pi'}"
        raise InputError(f"{one_line(changes)}, {text}", place="changes")
    data = _opened(thing, "")
    for name, value in changes.items():
        *parents, (last, entry) = parts_of(name)
        owner = data
        for parent, _ in parents:
            owner[parent] = _opened(owner.get(parent), name)
            owner = owner[parent]
        if entry is None:
            owner[last] = value
            continue
        entries: Any = owner.get(last)
        count = len(entries) if isinstance(entries, list | tuple) else 0
        if entry >= count:
            accepted = f"[1] to [{count}], or the whole list" if count else "the whole list"
            text = f"the list has {count or 'no'} entries, expected {accepted}"
            raise InputError(text, place=name)
        owner[last] = [*entries[:entry], value, *entries[entry + 1 :]]
    return data


def _opened(thing: object, name: str) -> dict[str, Any]:
    """Return the fields of a part as a new mapping."""
    if dataclasses.is_dataclass(thing):
        return dict(given_fields(thing))
    if thing is None or isinstance(thing, dict):
        return dict(thing or {})
    raise InputError("expected the dotted name of a field, 'controller.kind'", place=name)


# --- JSON Schemas ----------------------------------------------------------------------------


def inner(node: Schema, top: Schema) -> Schema:
    """Return the schema of a field without null, and with its reference resolved."""
    node = without_null(node)
    name = node.get("$ref", "").rpartition("/")[2]
    return node | top["$defs"][name] if name else node


def without_null(node: Schema) -> Schema:
    """Return the schema of a field without null."""
    options = [option for option in node.get("anyOf", []) if option.get("type") != "null"]
    rest = {name: value for name, value in node.items() if name != "anyOf"}
    return rest | options[0] if len(options) == 1 else node


def schema_at(top: Schema, name: str) -> Schema | None:
    """Return the schema of a field, or of the list of an entry; None if there is no such field."""
    node = top
    for part, _ in parts_of(name):
        if part not in node.get("properties", ()):
            return None
        node = inner(node["properties"][part], top)
    return node


def schema_leaves(
    top: Schema, node: Schema | None = None, name: str = ""
) -> Iterator[tuple[str, Schema]]:
    """Yield dotted name and schema of each field that is no mapping of fields."""
    node = inner(top if node is None else node, top)
    if "properties" not in node:
        yield name, node
    for key, field in node.get("properties", {}).items():
        yield from schema_leaves(top, field, dotted(name, key))
