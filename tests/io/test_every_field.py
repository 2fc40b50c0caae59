"""Every field of every model, generated from the schemas: wrong values, limits, wrong names."""

import dataclasses
import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from sdt_drake.io.errors import InputError, Problem
from sdt_drake.io.fields import Input, check, made
from sdt_drake.io.resources import models_dir
from sdt_drake.io.schema import Schema, inner, schema_of
from sdt_drake.machine.learn.state import FlightRecord
from sdt_drake.show.reference import FILES, SCHEMAS

FILE = Path("/runs/file.yaml")
FROM_FILES = [*FILES.values(), FlightRecord]


def models(base: type = Input) -> Iterator[type]:
    """The models of the package that files are read as, or are parts of."""
    if not (below := base.__subclasses__()) and base.__module__.startswith("sdt_drake"):
        yield base
    for model in below:
        yield from models(model)


MODELS = sorted(models(), key=str)


class Node(NamedTuple):
    """A field or a mapping of a model: its dotted place, its schema, and how a value of it makes
    the data of the model."""

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
    """All fields and mappings of a model, also those within others."""
    whole, top = COMMITTED[model.__name__]

    def within(node: Schema, place: str, data: Callable[[Any], Any]) -> Iterator[Node]:
        for option in (one for one in node.get("anyOf", ()) if "$ref" in one):
            tag = {"_tag": "!" + option["$ref"].rpartition("/")[2]}
            yield from within(inner(option, top), place, lambda value, tag=tag: data(tag | value))
        node = inner(node, top)
        if {"properties", "type", "enum"} & set(node):
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


def in_a_file(model: type, data: Any) -> list[Problem]:
    return problems_of(made, model, data, FILE)


def in_python(model: type, data: Any) -> list[Problem]:
    thing = blank(model)
    for name, assigned in data.items():
        setattr(thing, name, assigned)
    return problems_of(check, thing)


def problems_of(read: Callable[..., object], *arguments: Any) -> list[Problem]:
    try:
        read(*arguments)
    except InputError as error:
        return list(error.problems)
    return []


def blank(model: Any) -> Any:
    """An object with nothing but defaults; None where a field has to be given."""
    needed = (x for x in dataclasses.fields(model) if x.default is x.default_factory)
    return model(**dict.fromkeys(field.name for field in needed))  # both are MISSING


def is_told(problems: list[Problem], place: str) -> bool:
    """Once, in one line, with what is accepted."""
    told = [f"{one}" for one in problems if one.place == place and one.accepted]
    return len(told) == 1 and "\n" not in told[0] and len(told[0]) < 500


def test_every_model_is_that_of_a_file_or_of_a_part_of_one():
    assert set(COMMITTED) == {model.__name__ for model in MODELS}


WAYS = [(in_a_file, model) for model in FROM_FILES] + [(in_python, model) for model in MODELS]


@pytest.mark.parametrize(("way", "model"), WAYS)
def test_every_field_takes_its_limits_and_refuses_wrong_values_in_a_line(way, model):
    for node in nodes(model):
        if "properties" in node.schema or (way is in_python and "." in node.place):
            continue
        wrong = wrong_values(node.schema)
        refused = [value for value in wrong if is_told(way(model, node.data(value)), node.place)]
        assert repr(refused) == repr(wrong), node.place
        for last, _ in limits(node.schema):
            assert not is_told(way(model, node.data(last)), node.place), (node.place, last)


@pytest.mark.parametrize("model", FROM_FILES)
def test_names_that_are_a_letter_off_are_refused_with_the_right_one(model):
    for node in nodes(model):
        names = node.schema.get("properties", {})
        for right in names:
            for wrong in {f"{right}_", right[:-1], right[1:]} - {*names, ""}:
                place = f"{node.place}.{wrong}".lstrip(".")
                (told,) = (x for x in in_a_file(model, node.data({wrong: 1})) if x.place == place)
                assert right in told.near or len(right) < 3, told
                assert told.found == "no such field"


@pytest.mark.parametrize("model", MODELS)
def test_attributes_that_no_model_has_are_refused_at_once(model):
    for field in dataclasses.fields(model):
        told = f"no field '{field.name}_', did you mean .*'{field.name}'"
        with pytest.raises(AttributeError, match=told):
            setattr(blank(model), f"{field.name}_", 1)
