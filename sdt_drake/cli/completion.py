"""Completion by the shell: shipped names, files, fields of scenarios, controllers."""

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
    """Return a completer of shipped names of these kinds, and of files."""

    def complete(context: CompletionContext) -> list[str]:
        found = glob.glob(f"{glob.escape(context.incomplete)}*")
        # A folder is completed with its content. Alone, the shell would end the word after it.
        below = (x for path in found if os.path.isdir(path) for x in glob.glob(f"{path}/*"))
        return [*shipped(*kinds), *found, *below]

    return complete


def controllers(context: CompletionContext) -> list[str]:
    """Complete the last controller of a list with commas."""
    from sdt_drake.run.kinds import CONTROLLERS

    before, comma, _ = context.incomplete.rpartition(",")
    return [f"{before}{comma}{kind}" for kind in CONTROLLERS]


def fields(context: CompletionContext) -> list[str]:
    """Complete fields of a scenario with each choice, or with the default value."""
    schema = json.loads((models_dir() / "schemas" / "scenario.json").read_text(encoding="utf-8"))
    return [*_fields(schema, schema, "")]


def _fields(node: Any, top: Any, name: str) -> Iterator[str]:
    """Yield FIELD=VALUE for all fields below a node of a JSON Schema."""
    from sdt_drake.io.schema import inner

    node = inner(node, top)
    if "properties" in node:
        for key, field in node["properties"].items():
            yield from _fields(field, top, f"{name}.{key}".lstrip("."))
        return
    default = node.get("default")
    shown = "" if default is None or isinstance(default, list) else default
    yield from (f"{name}={value}" for value in node.get("enum", [shown]))
