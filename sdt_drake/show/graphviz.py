"""A Drake diagram as a block diagram: .dot, and .svg or .png where Graphviz is installed."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
from pathlib import Path

from pydrake.systems.framework import Diagram

from sdt_drake.io.errors import InputError, checked_choice, replacing
from sdt_drake.show.diagrams import NoWayError, Symbols, drawn, walk
from sdt_drake.show.symbols import SYMBOLS

FORMATS = ("dot", "svg", "png")
NO_GRAPHVIZ = "Graphviz is not installed ('dot' not found): apt install graphviz"

_ID = re.compile(r"\b(clusters|cluster|s|_)(\d+)(?=\b|[a-z:])")
_SUBSCRIPT = re.compile(rb'baseline-shift="sub" font-size="[\d.]+"')
_EDGES = re.compile(r"(?:^\S+ -> .*\n)+", re.MULTILINE)


def dot_text(diagram: Diagram, *, max_depth: int = 2, symbols: Symbols | None = None) -> str:
    """The diagram as a control engineer draws it, in Graphviz' language.

    Equal diagrams give equal texts. See `sdt_drake.show.diagrams` for what it shows.

    Args:
        diagram: any.
        max_depth: levels of diagrams in it that are opened.
        symbols: texts on blocks of one's own by the names of their classes; as in
            `sdt_drake.show.diagrams.walk`.

    Raises:
        InputError: for a diagram with more lines than can be drawn.
    """
    picture = walk(diagram, max_depth=max_depth, symbols={**SYMBOLS, **(symbols or {})})
    try:
        return drawn(picture)
    except NoWayError as error:
        raise InputError(str(error)) from None


def drake_dot_text(diagram: Diagram, *, max_depth: int = 2) -> str:
    """The diagram by Drake's own export, in Graphviz' language; equal diagrams give equal texts."""
    text = diagram.GetGraphvizString(max_depth=max_depth + 1)
    numbers: dict[str, str] = {}

    def renumbered(match: re.Match[str]) -> str:
        # Drake numbers systems in the order in which the process made them.
        number = numbers.setdefault(match[2], str(len(numbers) + 1))
        return match[1] + number

    return _EDGES.sub(_sorted_lines, _ID.sub(renumbered, text))


def _sorted_lines(match: re.Match[str]) -> str:
    # Drake lists connections in the order of memory addresses.
    return "".join(sorted(match[0].splitlines(keepends=True)))


def write_diagram(
    diagram: Diagram,
    path: str | Path,
    *,
    format_: str = "dot",
    max_depth: int = 2,
    drake: bool = False,
    symbols: Symbols | None = None,
) -> Path:
    """Write a diagram to `path` as "dot", "svg" or "png", by `drake_dot_text` if `drake`.

    Blocks of one's own have the `symbols` of `dot_text`. An .svg says in a comment which .dot text
    it was made from.

    Raises:
        InputError: for another format, or if Graphviz is needed and missing.
    """
    checked_choice(format_, FORMATS, "format")
    if drake:
        text = drake_dot_text(diagram, max_depth=max_depth)
    else:
        text = dot_text(diagram, max_depth=max_depth, symbols=symbols)
    return write_dot(text, Path(path), format_)


def write_dot(text: str, path: Path, format_: str) -> Path:
    """Write a text in Graphviz' language as one of FORMATS.

    Raises:
        InputError: if Graphviz is needed and missing.
    """
    with replacing(path) as partial:
        if format_ == "dot":
            partial.write_text(text, encoding="utf-8")
        else:
            partial.write_bytes(_rendered(text, format_))
    return path


def fingerprint(text: str) -> str:
    """A text of fixed length that tells one .dot text from another."""
    return f"dot sha256 {hashlib.sha256(text.encode()).hexdigest()}"


def has_graphviz() -> bool:
    """Whether Graphviz is there, so that .svg and .png can be written."""
    return shutil.which("dot") is not None


def _rendered(text: str, format_: str) -> bytes:
    if not has_graphviz():
        raise InputError(NO_GRAPHVIZ)
    done = subprocess.run(["dot", f"-T{format_}"], input=text.encode(), capture_output=True)
    if done.returncode != 0:
        reason = " ".join(done.stderr.decode(errors="replace").split())
        raise InputError(f"Graphviz failed: {reason}")
    if format_ != "svg":
        return done.stdout
    # Not every viewer of .svg knows baseline-shift, and none makes subscripts small.
    svg = _SUBSCRIPT.sub(b'dy="2.5" font-size="9"', done.stdout)
    return svg + f"<!-- {fingerprint(text)} -->\n".encode()
