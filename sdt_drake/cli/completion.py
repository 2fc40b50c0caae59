"""Completion by the shell: shipped names, files, fields of scenarios, controllers."""

from __future__ import annotations

import glob
import json
import os
from collections.abc import Callable
from typing import TYPE_CHECKING

from sdt_drake.io.names import Schema, schema_leaves
from sdt_drake.io.resources import models_dir, shipped

if TYPE_CHECKING:
    from cyclopts.completion import CompletionContext


def names(*kinds: str) -> Callable[[CompletionContext], list[str]]:
    """Return a completer of shipped names of these kinds, and of files."""

    def complete(context: CompletionContext) -> list[str]:
        found = glob.glob(f"{glob.escape(context.incomplete)}*")
        # A folder is completed with its content. Alone, the shell would end the word after it.
        folders = [path for path in found if os.path.isdir(path)]
        below = (x for path in folders for x in glob.glob(f"{glob.escape(path)}/*"))
        return [*shipped(*kinds), *found, *below]

    return complete


def controllers(context: CompletionContext) -> list[str]:
    """Complete the last controller of a list with commas."""
    kind = _scenario_schema()["$defs"]["ControllerOptions"]["properties"]["kind"]
    before, comma, _ = context.incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in kind["examples"]]


def fields(context: CompletionContext) -> list[str]:
    """Complete fields of a scenario with each choice, or with the default value."""
    leaves = [x for x in schema_leaves(_scenario_schema()) if "deprecated" not in x[1]]
    return [line for name, node in leaves for line in _lines(name, node)]


def _scenario_schema() -> Schema:
    text = (models_dir() / "schemas" / "scenario.json").read_text(encoding="utf-8")
    return json.loads(text)


def _lines(name: str, node: Schema) -> list[str]:
    """Return FIELD=VALUE for each choice of a field, or for its default value."""
    default = node.get("default")
    shown = "" if default is None or isinstance(default, list) else default
    return [f"{name}={value}" for value in node.get("enum", [shown])]
