"""Documents of headings, texts, tables and figures; as Markdown, and as a page in one HTML file.

Texts may hold `code`, **bold** and *emphasis*. What is not our own, such as names of users, needs
no care: the writer of pages escapes everything, that of Markdown tags and links.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from string import Template
from typing import Protocol
from xml.etree import ElementTree

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import read_text, write_text
from sdt_drake.show.texts import json_in_page, page_text

REPORT, MARKDOWN = "report.html", "report.md"

_MOST_BYTES = 100_000_000  # of a file

Inline = Callable[[str], str]
"""Text to HTML: escaped, with its marks."""


class Block(Protocol):
    """A part of a document."""

    def markdown(self) -> str:
        """The block in Markdown, without a line break at the end."""

    def html(self, inline: Inline) -> str:
        """The block in HTML, with its texts passed through `inline`."""


@dataclass(frozen=True)
class Text:
    """A paragraph; `look` is a class of page.css."""

    text: str
    look: str = ""

    def markdown(self) -> str:
        return _plain(self.text)

    def html(self, inline: Inline) -> str:
        return f"<p{_class(self.look)}>{inline(self.text)}</p>"


@dataclass(frozen=True)
class Heading:
    """A heading within a section."""

    text: str

    def markdown(self) -> str:
        return f"### {_plain(self.text)}"

    def html(self, inline: Inline) -> str:
        return f"<h3>{inline(self.text)}</h3>"


@dataclass(frozen=True)
class Bullets:
    """A list of texts."""

    items: Sequence[str]

    def markdown(self) -> str:
        return "\n".join(f"- {_plain(item)}" for item in self.items)

    def html(self, inline: Inline) -> str:
        items = "".join(f"<li>{inline(item)}</li>" for item in self.items)
        return f'<ul class="findings">{items}</ul>'


@dataclass(frozen=True)
class Tiles:
    """Counts that stand out: number, what of, and a class of page.css."""

    tiles: Sequence[tuple[int, str, str]]

    def markdown(self) -> str:
        return ", ".join(f"**{count}** {text}" for count, text, _ in self.tiles) + "."

    def html(self, inline: Inline) -> str:
        tiles = "".join(
            f'<li class="{look}"><strong>{count}</strong> {inline(text)}</li>'
            for count, text, look in self.tiles
        )
        return f'<ul class="tiles">{tiles}</ul>'


Cell = str | Sequence[str]
"""A text, or one for each joint."""


@dataclass(frozen=True)
class Table:
    """Cells of texts; the first of each row names it.

    A cell of a text for each joint spans as many columns on a page; the last cell of a row that is
    shorter than the header spans the rest. `look` is a class of page.css.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    title: str = ""
    look: str = ""

    def markdown(self) -> str:
        lines = [self.header, ["---"] * len(self.header), *self.rows]
        table = "\n".join(f"| {' | '.join(map(_cell, cells))} |" for cells in lines)
        return f"**{_plain(self.title)}**\n\n{table}" if self.title else table

    def html(self, inline: Inline) -> str:
        title = f"<h3>{inline(self.title)}</h3>" if self.title else ""
        first = self.rows[0] if self.rows else self.header
        spans = [0 if isinstance(cell, str) else len(cell) for cell in first]
        joints = max(spans, default=0)
        names, numbers = "", ""
        spans += [0] * (len(self.header) - len(spans))
        for text, span in zip(self.header, spans, strict=False):
            if span:
                names += f'<th class="first" colspan="{span}">{inline(text)}, joint</th>'
                numbers += "".join(f"<th{_first(k)}>{k + 1}</th>" for k in range(span))
            elif text:
                below = ' rowspan="2"' if joints else ""
                names += f'<th scope="col"{below}>{inline(text)}</th>'
            else:
                names += "<td></td>"
        head = f"<tr>{names}</tr>" if names else ""
        head += f"<tr>{numbers}</tr>" if joints else ""
        body = "".join(_row(cells, inline, len(self.header)) for cells in self.rows)
        look = _class("joints" if joints else self.look)
        return (
            f'{title}<div class="scroll" tabindex="0"><table{look}><thead>{head}</thead>'
            f"<tbody>{body}</tbody></table></div>"
        )


def _row(cells: Sequence[Cell], inline: Inline, width: int) -> str:
    name, *others = cells
    row = f'<th scope="row">{inline(str(name))}</th>'
    among_joints = any(not isinstance(cell, str) for cell in others)
    for cell in others:
        if isinstance(cell, str) and cell is cells[-1] and len(cells) < width:
            row += f'<td class="whole" colspan="{width - len(cells) + 1}">{inline(cell)}</td>'
        elif isinstance(cell, str):
            row += f"<td{_class('word' if among_joints else '')}>{inline(cell)}</td>"
        else:
            row += "".join(f"<td{_first(k)}>{inline(text)}</td>" for k, text in enumerate(cell))
    return f"<tr>{row}</tr>"


def _cell(cell: Cell) -> str:
    """In Markdown."""
    return _plain(cell if isinstance(cell, str) else " ".join(cell)).replace("|", "\\|")


def _plain(text: str) -> str:
    """A text in Markdown: tags and links, which are none of ours, are shown; code stays."""
    return re.sub(r"(`[^`]*`)|(<(?=[A-Za-z/!?])|\[(?=[^][]*\]\())", _escaped, text)


def _escaped(match: re.Match[str]) -> str:
    code, begin = match.groups()
    return code or f"\\{begin}"


def _first(k: int) -> str:
    """The first joint begins a group of columns."""
    return "" if k else ' class="first"'


@dataclass(frozen=True)
class Figure:
    """A picture with its caption, which is its text for those who do not see it, too.

    Attributes:
        caption: in words.
        svg: file of the picture; Markdown names the PNG beside it, where there is one.
        folder: of the document.
        look: a class of page.css: "wide" for pictures that a phone should not shrink.
    """

    caption: str
    svg: Path
    folder: Path
    look: str = ""

    def markdown(self) -> str:
        png = self.svg.with_suffix(".png")
        path = (png if png.is_file() else self.svg).relative_to(self.folder)
        return f"![{_plain(self.caption)}]({path.as_posix()})"

    def html(self, inline: Inline) -> str:
        data = base64.b64encode(read_svg(self.svg).encode()).decode()
        return (
            f'<figure><div class="canvas scroll {self.look}" tabindex="0">'
            f'<img alt="{html.escape(self.caption)}" src="data:image/svg+xml;base64,{data}"></div>'
            f"<figcaption>{inline(self.caption)}</figcaption></figure>"
        )


@dataclass(frozen=True)
class Details:
    """Blocks that the reader unfolds."""

    summary: str
    blocks: Sequence[Block]

    def markdown(self) -> str:
        blocks = "\n\n".join(block.markdown() for block in self.blocks)
        return f"<details><summary>{html.escape(self.summary)}</summary>\n\n{blocks}\n\n</details>"

    def html(self, inline: Inline) -> str:
        blocks = "".join(block.html(inline) for block in self.blocks)
        return f"<details><summary>{inline(self.summary)}</summary>{blocks}</details>"


@dataclass(frozen=True)
class Code:
    """A text shown as it is, in a typewriter's letters."""

    text: str

    def markdown(self) -> str:
        return f"```\n{self.text}\n```"

    def html(self, inline: Inline) -> str:
        return f"<pre>{html.escape(self.text)}</pre>"


@dataclass(frozen=True)
class EmbeddedPage:
    """A whole page, opened within this one when it is wanted; read from its file without `text`."""

    button: str
    path: Path
    text: str | None = None

    def markdown(self) -> str:
        return f"[{self.button}]({self.path.name})"

    def html(self, inline: Inline) -> str:
        text = read_text(self.path, _MOST_BYTES) if self.text is None else self.text
        return (
            f'<div class="recording"><button type="button" hidden>{inline(self.button)} '
            f"({len(text.encode()) / 1e6:.1f} MB, within this page)</button>"
            "<noscript>It needs JavaScript.</noscript></div>"
            f'<script type="application/json" id="recording-page">{json_in_page(text)}</script>'
        )


@dataclass
class Section:
    """A chapter, with a link at the top of the page; one without blocks is left out."""

    title: str
    blocks: list[Block] = field(default_factory=list)


@dataclass
class Document:
    """A title, a line below it, and sections.

    Attributes:
        symbols: whether pages show K_PS and tau_LD as in equations; not where inputs of users have
            such names.
    """

    title: str
    lead: str = ""
    sections: list[Section] = field(default_factory=list)
    symbols: bool = False

    def markdown(self) -> str:
        """The text of a Markdown file."""
        parts = [f"# {_plain(self.title)}", _plain(self.lead)]
        for section in self._shown():
            parts += [
                f"## {_plain(section.title)}",
                *(block.markdown() for block in section.blocks),
            ]
        return "\n\n".join(filter(None, parts)) + "\n"

    def html(self) -> str:
        """A page that needs no other file and no network.

        Raises:
            InputError: naming a picture that is missing or is none.
        """
        inline = partial(_inline, symbols=self.symbols)
        body, links = "", ""
        for number, section in enumerate(self._shown(), start=1):
            title = inline(section.title)
            blocks = "".join(block.html(inline) for block in section.blocks)
            body += f'<section id="section-{number}"><h2>{title}</h2>{blocks}</section>'
            links += f'<a href="#section-{number}">{title}</a>'
        has_plots = '<div class="plots">' in body
        return Template(page_text("page.html")).substitute(
            title=html.escape(self.title),
            lead=f"<p>{inline(self.lead)}</p>" if self.lead else "",
            links=links,
            css=page_text("page.css") + has_plots * page_text("uplot/uPlot.min.css"),
            js=page_text("page.js") + has_plots * _plots_js(),
            body=body,
        )

    def write(self, folder: Path) -> Path:
        """Write the document into a folder, as report.md and as a page; the path of the page.

        Raises:
            InputError: naming a picture that is missing or is none, or a file that cannot be
                written.
        """
        page = self.html()
        write_text(folder / MARKDOWN, self.markdown())
        return write_text(folder / REPORT, page)

    def _shown(self) -> list[Section]:
        return [section for section in self.sections if section.blocks]


def _plots_js() -> str:
    """What draws plots, with its licence."""
    own = map(page_text, ("uplot/LICENSE", "uplot/uPlot.iife.min.js", "plots.js"))
    return "/*! {} */\n{}\n{}".format(*own)


def read_svg(path: Path) -> str:
    """The text of an .svg file, to stand within a page.

    Raises:
        InputError: if there is none, or it is no SVG.
    """
    if not path.exists():
        raise InputError(f"{path}: is missing")
    text = read_text(path, _MOST_BYTES)
    try:
        is_svg = ElementTree.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
    except (ElementTree.ParseError, ValueError):
        is_svg = False
    if not is_svg:
        raise InputError(f"{path}: is not an SVG picture")
    return text


def _class(look: str) -> str:
    return f' class="{look}"' if look else ""


# --- marks in texts ---------------------------------------------------------------------------

_GREEK = {"omega": "ω", "zeta": "ζ", "tau": "τ"}
_SYMBOL = re.compile(
    r"(?<![A-Za-z_])(?:(omega|zeta|tau|I|K|d)_([A-Za-z0-9]+(?:,(?:max|min|\d)(?![\w]))?)"
    r"|(omega|zeta|tau)(?![A-Za-z_]))"
)


def _inline(text: str, *, symbols: bool) -> str:
    """HTML of a text; code is taken as it is."""
    words, *rest = re.split(r"`([^`]*)`", html.escape(text))
    result = _marked(words, symbols)
    for code, words in zip(rest[::2], rest[1::2], strict=True):
        result += f"<code>{code}</code>{_marked(words, symbols)}"
    return result


def _marked(text: str, symbols: bool) -> str:
    text = re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", text)
    text = re.sub(r"\*(\S[^*]*)\*", r"<i>\1</i>", text)
    return _SYMBOL.sub(_symbol, text) if symbols else text


def _symbol(match: re.Match[str]) -> str:
    """As it is printed in an equation."""
    letter, index, alone = match.groups()
    if alone:
        return _GREEK[alone]
    return f"{_GREEK.get(letter, letter)}<sub>{index}</sub>"
