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


def _fields(node: Any, top: Any, name: str) -> Iterator[str]:
    """Fields below a part of a JSON Schema, as --set takes them."""
    from sdt_drake.io.schema import inner

    node = inner(node, top)
    if "properties" in node:
        for key, field in node["properties"].items():
            yield from _fields(field, top, f"{name}.{key}".lstrip("."))
        return
    default = node.get("default")
    told = "" if default is None or isinstance(default, list) else default
    yield from (f"{name}={value}" for value in node.get("enum", [told]))
