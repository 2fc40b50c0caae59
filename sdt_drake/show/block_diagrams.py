"""Block diagrams of any Drake diagram as files: text in .dot, and pictures."""

import hashlib
import re
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

from pydrake.systems.framework import Diagram

from sdt_drake.io.arguments import one_of
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import replacing
from sdt_drake.show import diagrams
from sdt_drake.show.diagrams import NoWayError, Page, Symbols
from sdt_drake.show.style import style
from sdt_drake.show.symbols import SYMBOLS

FORMATS = ("dot", *diagrams.PICTURES)
NO_GRAPHVIZ = (
    "Drake's own picture needs Graphviz, which is not installed ('dot' not found): install it "
    "(apt install graphviz), or write a .dot file"
)

_ID = re.compile(r"\b(clusters|cluster|s|_)(\d+)(?=\b|[a-z:])")
_EDGES = re.compile(r"(?:^\S+ -> .*\n)+", re.MULTILINE)


def page_of(
    diagram: Diagram,
    *,
    max_depth: int = 2,
    symbols: Symbols | None = None,
    signals: Mapping[str, str] | None = None,
) -> Page:
    """Lay out a diagram as a control engineer draws it; see `sdt_drake.show.diagrams`.

    Args:
        diagram: a Drake diagram.
        max_depth: number of nested levels that are opened.
        symbols: texts on your own blocks by the names of their classes, as in
            `sdt_drake.show.diagrams.walk`.
        signals: other names of signals, by that of the output; `symbols.PAPER` has the paper's.

    Raises:
        InputError: if the diagram has more lines than can be drawn.
    """
    seen = diagrams.walk(diagram, max_depth=max_depth, symbols={**SYMBOLS, **(symbols or {})})
    for signal, name in seen.labels.items():
        seen.labels[signal] = (signals or {}).get(name, name)
    try:
        return diagrams.laid_out(seen)
    except NoWayError as error:
        raise InputError(str(error)) from None


def dot_text(diagram: Diagram, *, max_depth: int = 2, symbols: Symbols | None = None) -> str:
    """Return the page of `page_of` in Graphviz's language; equal diagrams give equal texts.

    >>> from pydrake.systems.framework import DiagramBuilder
    >>> from pydrake.systems.primitives import Integrator
    >>> builder = DiagramBuilder()
    >>> speed = builder.AddNamedSystem("speed", Integrator(1))
    >>> builder.ExportOutput(speed.get_output_port(), "speed")
    OutputPortIndex(0)
    >>> '"speed" [shape=box, label=<1/s>' in dot_text(builder.Build())
    True
    """
    return diagrams.dot_text(page_of(diagram, max_depth=max_depth, symbols=symbols))


def drake_dot_text(diagram: Diagram, *, max_depth: int = 2) -> str:
    """Return Drake's own export in Graphviz's language; equal diagrams give equal texts."""
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
    signals: Mapping[str, str] | None = None,
) -> Path:
    """Write a diagram to `path` as one of FORMATS.

    Args:
        diagram: a Drake diagram.
        path: the file.
        format_: one of FORMATS.
        max_depth: number of nested levels that are opened.
        drake: write Drake's own drawing (`drake_dot_text`); Graphviz draws its pictures.
        symbols: texts on your own blocks, as in `page_of`.
        signals: other names of signals, as in `page_of`.

    Raises:
        InputError: if the format is none of FORMATS, or Graphviz is needed and missing.
    """
    one_of(format_, "format", FORMATS)
    if not drake:
        page = page_of(diagram, max_depth=max_depth, symbols=symbols, signals=signals)
        return write_page(page, Path(path), format_)
    text = drake_dot_text(diagram, max_depth=max_depth).encode()
    return _write(Path(path), text if format_ == "dot" else _by_graphviz(text, format_))


def write_page(page: Page, path: Path, format_: str) -> Path:
    """Write a page as one of FORMATS; an .svg contains the fingerprint of its .dot text."""
    text = diagrams.dot_text(page)
    if format_ == "dot":
        return _write(path, text.encode())
    with style():
        return _write(path, diagrams.painted(page, format_, about=fingerprint(text)))


def fingerprint(text: str) -> str:
    """Return a hash that identifies a .dot text."""
    return f"dot sha256 {hashlib.sha256(text.encode()).hexdigest()}"


def _write(path: Path, content: bytes) -> Path:
    with replacing(path) as partial:
        partial.write_bytes(content)
    return path


def _by_graphviz(text: bytes, format_: str) -> bytes:
    if shutil.which("dot") is None:
        raise InputError(NO_GRAPHVIZ)
    done = subprocess.run(["dot", f"-T{format_}"], input=text, capture_output=True)
    if done.returncode != 0:
        reason = " ".join(done.stderr.decode(errors="replace").split())
        raise InputError(f"Graphviz failed: {reason}")
    return done.stdout
