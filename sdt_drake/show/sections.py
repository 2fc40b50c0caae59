"""Sections of reports, and the texts, tables, pictures and pages in them.

A `Marked` text is Markdown of this package; any other text is shown as it is, wherever it stands.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Formatter
from typing import TYPE_CHECKING

from sdt_drake.io.markdown import escaped
from sdt_drake.io.shown import formatted

if TYPE_CHECKING:  # tables of commands need no figures
    from matplotlib.figure import Figure

    from sdt_drake.show.panels import Plots, Stored

TEMPLATES = Path(__file__).with_name("templates")

# --- texts -----------------------------------------------------------------------------------


class Marked(str):
    """Markdown written by this package, which is not escaped."""


def marked(text: object) -> Marked:
    """Return Markdown that shows a text as it is; Markdown of this package stays."""
    return text if isinstance(text, Marked) else Marked(escaped(text))


class _Words(Formatter):
    def format_field(self, value: object, spec: str) -> str:
        if spec == "code":
            return code(value)
        if spec:
            value = formatted(value, spec).replace("%", " %")
        return marked(value)


def said(text: str, *values: object, **named: object) -> Marked:
    """Return Markdown with values in its braces, which are shown as they are, in one line.

    Texts that are not Marked lose blanks at their ends. Shares have a format such as `.1%`, and
    `code` is the format of inline code.

    >>> said("**{}** of {name:code}: {:.0%}, {:.1f}", "a*b", 0.5, float("nan"), name="x")
    '**a\\\\*b** of `x`: 50 %, –'
    """
    return Marked(_Words().vformat(text, values, named))


def joined(texts: Iterable[str], separator: str = ", ") -> Marked:
    """Join texts to Markdown, each as it is."""
    return Marked(separator.join(map(marked, texts)))


def bullets(texts: Iterable[str]) -> Marked:
    """Return a list of texts, or of Markdown, as Markdown."""
    return Marked("\n".join(f"- {marked(text)}" for text in texts))


def code(value: object) -> Marked:
    """Return a text as inline code, or escaped where Markdown cannot show it as code."""
    text = str(value)
    return Marked(f"`{text}`" if re.fullmatch(r"[^`|\r\n]+", text) else escaped(text))


def fenced(text: str) -> Marked:
    """Return a text as a fenced code block."""
    fence = max(["```", *(f"{run}`" for run in re.findall("`{3,}", text))], key=len)
    return Marked(f"{fence}\n{text}\n{fence}")


def plain(text: str) -> str:
    """Return lines of Markdown as plain text."""
    return re.sub(r"(?m)^> |\*\*|`|\\(?=[^\w\s])", "", text)


def capital(text: str) -> str:
    """Return a text with a capital first letter; the others stay, unlike with `str.capitalize`."""
    return type(text)(text[:1].upper() + text[1:])


# --- blocks ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Table:
    """A table of texts; the first cell of a row is its name.

    >>> table = Table(["joint", "mass [kg]"], [["1", "2.5"], ["2", "–"]])
    >>> table.is_numeric()
    [True, True]
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    """Cells, as many in each row as in the header."""
    title: str = ""

    def is_numeric(self) -> list[bool]:
        """Check for each column if all cells are numbers or dashes."""
        columns = zip(*self.rows, strict=True) if self.rows else ([] for _ in self.header)
        return [all(map(_NUMBER.fullmatch, cells)) for cells in columns]


_NUMBER = re.compile(r"[-+−–±∞\d., e%]*")


def spread(
    header: Sequence[str], rows: Sequence[Sequence[str | Sequence[str]]], title: str = ""
) -> Table:
    """Make a table whose cells hold one text, or a text per joint, which get a column each.

    >>> spread(["run", "error [rad/s]"], [["pi", ["0.1", "0.2"]]]).header
    ['run', 'error [rad/s], joint 1', '2']
    """
    counts = [0 if isinstance(cell, str) else len(cell) for cell in rows[0]]
    names = [
        name
        for text, count in zip(header, counts, strict=True)
        for name in [f"{text}, joint 1" if count else text, *map(str, range(2, count + 1))]
    ]
    cells = [
        [x for cell in row for x in ([cell] if isinstance(cell, str) else cell)] for row in rows
    ]
    return Table(names, cells, title)


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture with a caption: a figure, plots, or a file that is there already."""

    name: str
    """The path of the picture in Markdown, from the folder of the report; pages have the .svg."""
    caption: str
    content: Figure | Plots | Stored | None = None
    """Plots are interactive on a page. None stands for a file, and so does Stored for Markdown."""


@dataclass(frozen=True)
class Page:
    """An HTML page that a button of the report opens, and to which Markdown links."""

    name: str
    """The path from the folder of the report."""
    button: str
    text: str | None = None
    """The text of the page; None stands for a file."""


@dataclass(frozen=True)
class Box:
    """Blocks within an HTML element, in Markdown, too."""

    tag: str
    blocks: Sequence[Block]
    attributes: str = ""
    head: str = ""
    """HTML before the blocks."""


@dataclass(frozen=True)
class Row:
    """A row of a table that opens to blocks."""

    cells: Sequence[str]
    """The texts of the row; the last one is coloured."""
    blocks: Sequence[Block]
    verdict: str
    look: str
    """Class of page.css, which colours the last cell."""


@dataclass(frozen=True)
class Rows:
    """A table whose rows open; in Markdown, parts that are folded."""

    header: Sequence[str]
    rows: Sequence[Row]


Block = str | Table | Picture | Page | Box | Rows
"""A part of a section: paragraphs, tables, a picture, a page, or a box of them."""


@dataclass(frozen=True)
class Section:
    """A chapter of a report: a title, and text, tables, pictures and pages in their order."""

    title: str
    blocks: Sequence[Block]


def tiles(counts: Iterable[tuple[int, str, str]]) -> Box:
    """Make a row of counts; each has its words and its class of page.css."""
    made = [
        Box("div", [said("**{}** {}", count, words)], f' class="{look}"')
        for count, words, look in counts
    ]
    return Box("div", made, ' class="tiles"')


def details(title: str, *blocks: Block) -> Box:
    """Make a part that is folded until the reader opens it."""
    words = html.escape(" ".join(title.split())).replace("\0", "\ufffd")  # as in Markdown
    return Box("details", blocks, head=f"<summary>{words}</summary>")
