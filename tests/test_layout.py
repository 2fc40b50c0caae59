"""The way of the data: imports run in one direction only."""

from __future__ import annotations

import ast
import re
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "sdt_drake"

# The layout lists them from the bottom up.
PAGE = (PACKAGE.parent / "tests/benchmarks/README.md").read_text(encoding="utf-8")
LISTED = re.findall(r"^      ((?:\w+(?:\.py|/)(?:, )?)+)", PAGE, re.MULTILINE)
ORDER = [re.sub(r"\.py|/", "", name) for line in LISTED for name in line.split(", ")]


def part_of(module: str) -> str:
    return module.removeprefix("sdt_drake.").split(".")[0]


def types_alone(tree):
    """What is imported for annotations alone: a controller is made with a design."""
    guarded = (n for n in ast.walk(tree) if isinstance(n, ast.If))
    return {
        inner
        for node in guarded
        if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }


def test_every_import_goes_up_in_the_layout():
    for file in PACKAGE.rglob("*.py"):
        own = file.relative_to(PACKAGE).with_suffix("").parts[0]
        if own == "__init__":
            continue
        tree = ast.parse(file.read_text(encoding="utf-8"))
        for node in set(ast.walk(tree)) - types_alone(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("sdt_drake."):
                other = part_of(node.module)
                assert ORDER.index(other) <= ORDER.index(own), f"{file.name} imports {node.module}"


def test_no_star_import_and_no_pydrake_all():
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        assert "import *" not in text and "pydrake.all" not in text, file
