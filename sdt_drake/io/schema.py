"""What a file may hold, from the fields of its dataclass: as rows for people, as a JSON Schema.

Names, types, defaults and rules are those of `fields`, meanings those of the docstrings.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
import typing
from collections.abc import Iterator, Sequence
from dataclasses import MISSING, replace
from functools import cache
from typing import Any, NamedTuple

from sdt_drake.io.fields import (
    Rule,
    dataclasses_of,
    default_of,
    expected,
    hints_of,
    options_of,
    rule_of,
)

Schema = dict[str, Any]


class Entry(NamedTuple):
    """A field of a file, for people.

    Attributes:
        name: dotted, from the top of the file; entries of a list are [].
        takes: type and bounds.
        unit: with the side, where that makes a difference; "-" for shares, factors and counts.
        default: what it is where it is not given; "" where it must be.
        meaning: in words.
    """

    name: str
    takes: str
    unit: str
    default: str
    meaning: str


class Part(NamedTuple):
    """A mapping of a file: its place or tag, what it is, and its fields."""

    title: str
    text: str
    entries: Sequence[Entry]


def parts(schema: type, name: str = "") -> Iterator[Part]:
    """The mapping that a dataclass stands for, and all within it, each once."""
    yield from _parts(schema, name, "", set())


def _parts(schema: type, title: str, prefix: str, seen: set[type]) -> Iterator[Part]:
    fields = dataclasses.fields(schema)
    entries = (entry_of(schema, field) for field in fields)
    rows = [entry._replace(name=prefix + entry.name) for entry in entries]
    yield Part(title, _split(schema)[0], rows)
    for field in fields:
        place, hint = prefix + field.name, hints_of(schema)[field.name]
        if typing.get_origin(hint) is list:
            place, hint = f"{place}[]", typing.get_args(hint)[0]
        inner = dataclasses_of(hint)
        for option in inner:
            if len(inner) == 1:
                yield from _parts(option, place, f"{place}.", seen)
            elif option not in seen:  # a tag has the same fields wherever it stands
                seen.add(option)
                yield from _parts(option, f"!{option.__name__}", "", seen)


def entry_of(schema: type, field: dataclasses.Field[Any]) -> Entry:
    """A field of a dataclass, for people."""
    rule, default = rule_of(field), default_of(field)
    hint = hints_of(schema)[field.name]
    return Entry(
        name=field.name,
        takes=expected(hint, replace(rule, unit="", more_by="")) + _beside(rule),
        unit=", ".join(filter(None, [rule.unit, rule.side and f"{rule.side} side"])),
        default=_told(hint, default),
        meaning=meanings(schema).get(field.name, ""),
    )


def _beside(rule: Rule) -> str:
    count = f", {rule.count} of them" if rule.count else ""
    return f"{count}, or what {rule.more_by} has" if rule.more_by else count


def _told(hint: Any, default: Any) -> str:
    if default is MISSING or (default is None and type(None) not in options_of(hint)):
        return ""
    if dataclasses.is_dataclass(default):
        return "as below"
    if default in (None, "", []):
        return "none"
    if isinstance(default, list):
        return f"[{', '.join(x if isinstance(x, str) else f'{x:.12g}' for x in default)}]"
    if isinstance(default, bool):
        return "true" if default else "false"
    return f"{default:.12g}" if isinstance(default, float) else str(default)


@cache
def meanings(schema: type) -> dict[str, str]:
    """What the docstrings of a dataclass and of those it derives from say of each field."""
    found: dict[str, str] = {}
    for base in reversed(schema.__mro__):
        for entry in re.split(r"\n {4}(?=\w)", _split(base)[1]):
            names, _, meaning = entry.strip().partition(":")
            found |= dict.fromkeys(names.split(", "), " ".join(meaning.split()))
    return found


def _split(schema: type) -> tuple[str, str]:
    """What a docstring says of the class, in one line a paragraph, and of its attributes."""
    text, _, attributes = inspect.cleandoc(schema.__doc__ or "").partition("\nAttributes:\n")
    paragraphs = (" ".join(paragraph.split()) for paragraph in text.split("\n\n"))
    return "\n\n".join(filter(None, paragraphs)), "\n" + attributes


# --- JSON Schema -----------------------------------------------------------------------------


def json_schema(schema: type, title: str) -> Schema:
    """The JSON Schema (draft 7, which editors know) of files that a dataclass stands for.

    It lacks what takes the robot, other files, or several fields at once. Tags are no part of JSON:
    what has several (`!Ramp`, `!Hold`) may be any of them.
    """
    definitions: dict[str, Schema] = {}
    top = _mapping(schema, definitions)
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": title,
        **top,
        "patternProperties": {"^_": {}},  # of anchors; the reader leaves them out
        "definitions": dict(sorted(definitions.items())),
    }


def _mapping(schema: type, definitions: dict[str, Schema]) -> Schema:
    mapping: Schema = {
        "type": "object",
        "description": _split(schema)[0],
        "properties": {},
        "additionalProperties": False,
    }
    for field in dataclasses.fields(schema):
        entry, rule = entry_of(schema, field), rule_of(field)
        value = _value(hints_of(schema)[field.name], rule, definitions)
        value["description"] = entry.meaning + (f" [{entry.unit}]" if entry.unit else "")
        default = default_of(field)
        if not entry.default:
            mapping.setdefault("required", []).append(field.name)
        elif entry.default not in ("none", "as below"):
            value["default"] = default
        if default not in ("", []) and not rule.empty:
            value |= {"string": {"minLength": 1}, "array": {"minItems": 1}}.get(_kind(value), {})
        if rule.count:
            value |= {"minItems": rule.count, "maxItems": rule.count}
        if rule.more_by:
            own = {field.name: {"enum": value.pop("enum")}}
            mapping |= {"if": {"required": [rule.more_by]}, "else": {"properties": own}}
        mapping["properties"][field.name] = value
    if "required" not in mapping:
        mapping["type"] = ["object", "null"]  # "friction:" and nothing below it
    return mapping


def _value(hint: Any, rule: Rule, definitions: dict[str, Schema]) -> Schema:
    options = options_of(hint)
    null = ["null"] * (type(None) in options)
    inner = dataclasses_of(hint)
    for option in inner:
        if option.__name__ not in definitions:
            definitions[option.__name__] = _mapping(option, definitions)
    if inner:
        references = [{"$ref": f"#/definitions/{option.__name__}"} for option in inner]
        return {"anyOf": [*references, *({"type": name} for name in null)]}
    kind = _KINDS.get(options[0], "array")
    value: Schema = {"type": [kind, *null] if null else kind}
    if kind == "array":
        value["items"] = _value(typing.get_args(options[0])[0], rule, definitions)
    elif kind == "string" and rule.choices:
        value["enum"] = [*rule.choices, *([None] if null else [])]
    elif kind in ("number", "integer"):
        limits = {name: getattr(rule, own) for name, own in _LIMITS.items()}
        value |= {name: limit for name, limit in limits.items() if math.isfinite(limit)}
    return value


def _kind(value: Schema) -> str:
    kind = value.get("type", "")
    return kind if isinstance(kind, str) else kind[0]


_KINDS = {float: "number", int: "integer", bool: "boolean", str: "string"}
_LIMITS = {
    "minimum": "minimum",
    "exclusiveMinimum": "above",
    "maximum": "maximum",
    "exclusiveMaximum": "below",
}
