"""Completion by the shell: names of what ships, files, fields of scenarios, controllers."""

from __future__ import annotations

import glob
import json
import os
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from sdt_drake.io.resources import models_dir, shipped

if TYPE_CHECKING:
    from cyclopts.completion import CompletionContext


def names(*kinds: str) -> Callable[[CompletionContext], list[str]]:
    """Complete names of what ships of these kinds, and files."""

    def complete(context: CompletionContext) -> list[str]:
        found = glob.glob(f"{glob.escape(context.incomplete)}*")
        # What is in a folder comes with it: alone, the shell would take its name for a whole word.
        below = (x for path in found if os.path.isdir(path) for x in glob.glob(f"{path}/*"))
        return [*shipped(*kinds), *found, *below]

    return complete


def controllers(context: CompletionContext) -> list[str]:
    """Complete the last one of a list of controllers."""
    from sdt_drake.run.kinds import CONTROLLERS

    before, comma, _ = context.incomplete.rpartition(",")
    return [f"{before}{comma}{kind}" for kind in CONTROLLERS]


def fields(context: CompletionContext) -> list[str]:
    """Complete fields of a scenario, with each of their choices, or the default."""
    schema = json.loads((models_dir() / "schemas" / "scenario.json").read_text(encoding="utf-8"))
    return [*_fields(schema, schema, "")]


def _fields(schema: Any, part: Any, name: str) -> Iterator[str]:
    """Fields below a part of a JSON Schema, as --set takes them."""
    if "$ref" in part:
        *_, group, key = part["$ref"].split("/")
        part = schema[group][key]
    below = [
        found
        for choice in (*part.get("anyOf", ()), *part.get("oneOf", ()))
        for found in _fields(schema, choice, name)
        if "." in found
    ]
    for key, value in part.get("properties", {}).items():
        below += _fields(schema, value, f"{name}.{key}" if name else key)
    default = part.get("default", "")
    told = "" if isinstance(default, list | dict) else default
    values = [value for value in part.get("enum", [told]) if value is not None]
    yield from below or (f"{name}={value}" for value in values)
