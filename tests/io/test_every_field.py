"""Every field of every model, generated from the schemas: wrong values, limits, wrong names."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import Input, made
from sdt_drake.io.resources import models_dir
from sdt_drake.io.schema import Schema, inner, schema_of
from sdt_drake.machine.learn.state import FlightRecord
from sdt_drake.show.reference import FILES, SCHEMAS

FILE = Path("/runs/file.yaml")


def models(base: type = Input) -> Iterator[str]:
    """Names of the models of the package that files are read as, or are parts of."""
    if not (below := base.__subclasses__()) and base.__module__.startswith("sdt_drake"):
        yield base.__name__
    for model in below:
        yield from models(model)


class Node(NamedTuple):
    """A field of a model: its dotted place, its schema, and how a value makes the model's data."""

    place: str
    schema: Schema
    data: Callable[[Any], Any]


def committed_schemas() -> dict[str, tuple[Schema, Schema]]:
    """Schema of each model by its name, as editors are told it, and the whole that it is in."""
    found = {"FlightRecord": 2 * (schema_of(FlightRecord),)}  # which nobody edits
    for topic, model in FILES.items():
        top = json.loads((models_dir() / SCHEMAS / f"{topic}.json").read_text(encoding="utf-8"))
        found |= {name: (part, top) for name, part in top.get("$defs", {}).items()}
        found[model.__name__] = top, top
    return found


COMMITTED = committed_schemas()


def nodes(model: type) -> Iterator[Node]:
    """All fields of a model, also those within others."""
    whole, top = COMMITTED[model.__name__]

    def within(node: Schema, place: str, data: Callable[[Any], Any]) -> Iterator[Node]:
        for option in (one for one in node.get("anyOf", ()) if "$ref" in one):
            tag = {"_tag": "!" + option["$ref"].rpartition("/")[2]}
            yield from within(inner(option, top), place, lambda value, tag=tag: data(tag | value))
        node = inner(node, top)
        if "properties" not in node and {"type", "enum"} & set(node):
            yield Node(place, node, data)
        for name, field in node.get("properties", {}).items():
            dotted = f"{place}.{name}".lstrip(".")
            yield from within(field, dotted, lambda value, name=name: data({name: value}))
        if "items" in node:
            count = node.get("minItems", 1)
            yield from within(node["items"], f"{place}[1]", lambda value: data([value] * count))

    yield from within(whole, "", lambda value: value)


def limits(schema: Schema) -> Iterator[tuple[float, float]]:
    """The last number that is taken at each bound, and the first that is not."""
    for name, bound in schema.items() if schema.get("type") in ("number", "integer") else ():
        if name.lower().endswith(("minimum", "maximum")):
            outwards = -math.inf if name.lower().endswith("minimum") else math.inf
            if schema["type"] == "integer":
                yield bound, bound + int(math.copysign(1, outwards))
            elif name.startswith("exclusive"):
                yield math.nextafter(bound, -outwards), bound
            else:
                yield bound, math.nextafter(bound, outwards)


def wrong_values(schema: Schema) -> list[Any]:
    """Values of other types and beyond limits, and lists that are too short or too long."""
    kind = schema.get("type", "string")
    if "enum" in schema:
        return ["no such choice", 3, True, [1.0], math.nan]
    if kind in ("number", "integer"):
        outside = [outer for _, outer in limits(schema)]
        broken = [1.5] * (kind == "integer")
        return [True, False, "1", "x", [1.0], math.nan, math.inf, -math.inf, *broken, *outside]
    if kind == "boolean":
        return [0, 1, "yes", "x", math.nan, [True]]
    if kind == "string":
        return [3, 1.5, True, math.nan, ["a"], *[""] * (schema.get("minLength", 0) > 0)]
    lists = [[]] * ("minItems" in schema) + [[1.0] * 9] * ("maxItems" in schema)
    return [3, True, math.nan, *["x"] * (kind == "array"), *lists]


def is_told(model: type, node: Node, value: Any) -> bool:
    """Once, in one line, with what is accepted."""
    try:
        made(model, node.data(value), FILE)
    except InputError as error:
        told = [f"{one}" for one in error.problems if one.place == node.place and one.accepted]
        return len(told) == 1 and "\n" not in told[0] and len(told[0]) < 500
    return False


def test_every_model_is_that_of_a_file_or_of_a_part_of_one():
    assert set(COMMITTED) == set(models())


@pytest.mark.parametrize("model", [*FILES.values(), FlightRecord])
def test_every_field_takes_its_limits_and_refuses_wrong_values_in_a_line(model):
    for node in nodes(model):
        wrong = wrong_values(node.schema)
        refused = [value for value in wrong if is_told(model, node, value)]
        assert repr(refused) == repr(wrong), node.place
        for last, _ in limits(node.schema):
            assert not is_told(model, node, last), (node.place, last)
