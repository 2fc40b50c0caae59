"""A Drake diagram as a block diagram: .dot, and .svg or .png where Graphviz is installed."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
from pathlib import Path

from pydrake.systems.framework import Diagram

from sdt_drake.errors import InputError, checked_choice, replacing

FORMATS = ("dot", "svg", "png")
NO_GRAPHVIZ = "Graphviz is not installed ('dot' not found): apt install graphviz"

_ID = re.compile(r"\b(clusters|cluster|s|_)(\d+)(?=\b|[a-z:])")
_EDGES = re.compile(r"(?:^\S+ -> .*\n)+", re.MULTILINE)


def dot_text(diagram: Diagram, *, max_depth: int = 1) -> str:
    """The diagram in Graphviz' language; equal diagrams give equal texts.

    The plant is split into its inputs and outputs, so that signals run from left to right.

    Args:
        diagram: best built with `boxed=True`.
        max_depth: levels of boxes that are opened.
    """
    split = {
        f"{system.get_name()}/split": "I/O"
        for system in diagram.GetSystems()
        if system.get_name() in ("axis_process", "multibody_plant")
    }
    text = diagram.GetGraphvizString(max_depth=max_depth, options=split)
    numbers: dict[str, str] = {}

    def renumbered(match: re.Match[str]) -> str:
        # Drake numbers systems in the order in which the process made them.
        number = numbers.setdefault(match[2], str(len(numbers) + 1))
        return match[1] + number

    text = _EDGES.sub(_sorted_lines, _ID.sub(renumbered, text))
    # What a box is called is what a reader looks for; that it is a Diagram says nothing.
    text = re.sub(r"<B>Diagram</B><BR/>\nname=([^\n<]+)", r"<B>\1</B>", text)
    return re.sub(r"<B>(\w+)</B><BR/>\nname=([^\n<]+)", r"<B>\2</B><BR/>\1", text)


def _sorted_lines(match: re.Match[str]) -> str:
    # Drake lists connections in the order of memory addresses.
    return "".join(sorted(match[0].splitlines(keepends=True)))


def write_diagram(
    diagram: Diagram, path: str | Path, *, format_: str = "dot", max_depth: int = 1
) -> Path:
    """Write a diagram to `path` as "dot", "svg" or "png".

    An .svg says in a comment which .dot text it was made from.

    Raises:
        InputError: for another format, or if Graphviz is needed and missing.
    """
    path = Path(path)
    checked_choice(format_, FORMATS, "format")
    text = dot_text(diagram, max_depth=max_depth)
    with replacing(path) as partial:
        if format_ == "dot":
            partial.write_text(text, encoding="utf-8")
        else:
            partial.write_bytes(_rendered(text, format_))
    return path


def fingerprint(text: str) -> str:
    """Tells one .dot text from another."""
    return f"dot sha256 {hashlib.sha256(text.encode()).hexdigest()}"


def has_graphviz() -> bool:
    """Whether svg and png can be written."""
    return shutil.which("dot") is not None


def _rendered(text: str, format_: str) -> bytes:
    if not has_graphviz():
        raise InputError(NO_GRAPHVIZ)
    done = subprocess.run(["dot", f"-T{format_}"], input=text.encode(), capture_output=True)
    if done.returncode != 0:
        reason = " ".join(done.stderr.decode(errors="replace").split())
        raise InputError(f"Graphviz failed: {reason}")
    note = f"<!-- {fingerprint(text)} -->\n".encode() if format_ == "svg" else b""
    return done.stdout + note
