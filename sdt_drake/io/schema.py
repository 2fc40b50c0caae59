"""JSON Schemas of the models of files, and the rows of the reference from them."""

import ast
import contextlib
import copy
import inspect
import itertools
import textwrap
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple, cast

from pydantic import ConfigDict, TypeAdapter
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import core_schema

from sdt_drake.io.names import Schema, inner, without_null

CONFIG = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
"""Configuration of pydantic for all models."""

_BOUNDS = {">": "exclusiveMinimum", ">=": "minimum", "<=": "maximum", "<": "exclusiveMaximum"}
_NAMES = {"gt": _BOUNDS[">"], "ge": _BOUNDS[">="], "le": _BOUNDS["<="], "lt": _BOUNDS["<"]}
_TYPES = {"number": "number", "integer": "whole number", "string": "text", "array": "list"}


class Entry(NamedTuple):
    """The row of a field in the reference."""

    name: str
    """Dotted name from the top of the file; entries of a list are []."""
    takes: str
    """Type and limits."""
    unit: str
    """Unit, with the side where it matters; "-" for shares, factors and counts."""
    default: str
    """Default value; "" for a required field."""
    meaning: str
    """Description."""


class Part(NamedTuple):
    """A mapping of a file: its place or tag, its description, and its fields."""

    title: str
    text: str
    entries: Sequence[Entry]


# --- JSON Schema -----------------------------------------------------------------------------


class _Generator(GenerateJsonSchema):
    """A generator of schemas with the docstrings of fields.

    It leaves out tags, because JSON has none: a union accepts any option.
    """

    def dataclass_schema(self, schema: core_schema.DataclassSchema) -> Schema:
        made = super().dataclass_schema(schema)
        for name, text in _docstrings(cast(Any, schema["cls"])).items():
            if name in made["properties"]:
                made["properties"][name] = {"description": text} | made["properties"][name]
        return made

    def tagged_union_schema(self, schema: core_schema.TaggedUnionSchema) -> Schema:
        return {"anyOf": [self.generate_inner(option) for option in schema["choices"].values()]}

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


@cache
def adapter(model: Any) -> TypeAdapter[Any]:
    """Return pydantic's validator of a model."""
    return TypeAdapter(model)


@cache
def schema_of(model: Any) -> Schema:
    """Make the JSON Schema of a model."""
    made: Schema = _tidied(adapter(model).json_schema(schema_generator=_Generator))
    return made


@cache
def _docstrings(model: type) -> dict[str, str]:
    """Return the docstrings of a dataclass' fields, also of inherited ones.

    pydantic's own, `use_attribute_docstrings`, would read the source whenever a model is used.
    """
    texts: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if "__dataclass_params__" not in vars(base):
            continue
        with contextlib.suppress(OSError, TypeError):  # of a class that was made without a file
            (tree,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
            for field, text in itertools.pairwise(getattr(tree, "body", ())):
                match field, text:
                    case (
                        ast.AnnAssign(target=ast.Name(id=name)),
                        ast.Expr(value=ast.Constant(value=str(words))),
                    ):
                        texts[name] = inspect.cleandoc(words)
    return texts


def _tidied(node: Any) -> Any:
    """Rename limits to the names of JSON Schema, and remove line breaks from texts."""
    if isinstance(node, list):
        return [_tidied(entry) for entry in node]
    if isinstance(node, dict):
        return {_NAMES.get(name, name): _tidied(value) for name, value in node.items()}
    if isinstance(node, str):
        return "\n\n".join(" ".join(part.split()) for part in node.split("\n\n"))
    return node


def json_schema(model: type, title: str) -> Schema:
    """Make the JSON Schema (draft 7, for editors) of the files of a model.

    The schema lacks rules that need the robot, other files, or several fields.
    """
    top = copy.deepcopy(schema_of(model))
    for mapping in (top, *top.get("$defs", {}).values()):
        if "required" not in mapping:
            mapping["type"] = ["object", "null"]  # a key without a value: "friction:"
        for field in mapping["properties"].values():
            if "unit" in field:
                field["description"] = f"{field.get('description', '')} [{unit_of(field)}]".strip()
    head = {"$schema": "http://json-schema.org/draft-07/schema#", **top, "title": title}
    return head | {"patternProperties": {"^_": {}}}  # anchors, ignored by the reader


# --- texts -----------------------------------------------------------------------------------


def expected(node: Schema, *, unit: bool = True) -> str:
    """Return the accepted values of a field as text: "a number > 0 [s]"."""
    node = without_null(node)
    if "properties" in node:
        return f"a mapping with {', '.join(node['properties'])}"
    if models := _models(node):
        return models.replace("mappings", "a mapping")
    if "enum" in node:
        return f"one of {', '.join(filter(None, node['enum']))}"
    bounds = _bounds(node, unit=unit)
    if "array" in node["type"]:
        items = node["items"]
        if "enum" in items:
            return f"some of {', '.join(items['enum'])}"
        plural = _models(items) or f"{_TYPES[items['type']]}s"
        each = ", one for each joint" * node.get("per_joint", False)
        each += " or one text" * (node["type"] != "array")
        return f"a list of {plural}{_bounds(items | node, unit=unit)}{each}"
    if node["type"] == "boolean":
        return "true or false"
    such = f", such as {', '.join(node['examples'])}" if "examples" in node else ""
    return f"a {_TYPES[node['type']]}{bounds}{such}"


def _bounds(node: Schema, *, unit: bool) -> str:
    """Return the limits of a number: " > 0 and <= 1 [s]"."""
    bounds = [f"{sign} {node[name]:.12g}" for sign, name in _BOUNDS.items() if name in node]
    has_unit = unit and node.get("unit", "-") != "-"
    return f" {' and '.join(bounds)}" * bool(bounds) + (f" [{node['unit']}]" if has_unit else "")


def _models(node: Schema) -> str:
    """Return the tags of a union of models, "mappings" for one model, "" for none."""
    options = node.get("anyOf", [node])
    names = [option["$ref"].rpartition("/")[2] for option in options if "$ref" in option]
    return ", ".join(f"!{name}" for name in names) if len(names) > 1 else "mappings" * len(names)


def unit_of(field: Schema) -> str:
    """Return the unit of a field, with its side where it matters."""
    side = f"{field['side']} side" if "side" in field else ""
    return ", ".join(filter(None, (field.get("unit", ""), side)))


def parts(model: type) -> Iterator[Part]:
    """Yield the mapping of a model and all mappings in it, each once."""
    top = schema_of(model)
    yield from _parts(top, top, "", "", set())


def _parts(mapping: Schema, top: Schema, title: str, prefix: str, seen: set[str]) -> Iterator[Part]:
    fields, needed = mapping["properties"], mapping.get("required", [])
    rows = [
        Entry(
            name=prefix + name,
            takes=expected(field, unit=False) + _count(field),
            unit=unit_of(field),
            default="" if name in needed else _default(field),
            meaning=field.get("description", ""),
        )
        for name, field in fields.items()
    ]
    yield Part(title, mapping["description"], rows)
    for name, field in fields.items():
        place, node = prefix + name, without_null(field)
        if "items" in node:
            place, node = f"{place}[]", node["items"]
        if "$ref" in node:
            yield from _parts(inner(node, top), top, place, f"{place}.", seen)
        for option in node.get("anyOf", []):
            tag = "!" + option["$ref"].rpartition("/")[2]
            if tag not in seen:  # a tag has the same fields everywhere
                seen.add(tag)
                yield from _parts(inner(option, top), top, tag, "", seen)


def _count(field: Schema) -> str:
    at_most = "" if "minItems" in field else "at most "
    return f", {at_most}{field['maxItems']} of them" if "maxItems" in field else ""


def _default(field: Schema) -> str:
    if "default" not in field:
        return "as below"
    default = field["default"]
    if default is None and without_null(field) is field:  # null is refused: the field is required
        return ""
    if default in (None, "", []):
        return "none"
    if isinstance(default, list):
        return f"[{', '.join(x if isinstance(x, str) else f'{x:.12g}' for x in default)}]"
    if isinstance(default, bool):
        return "true" if default else "false"
    return f"{default:.12g}" if isinstance(default, float) else str(default)
