"""Reports: sections, rendered once to Markdown and once to an offline page.

Pages show HTML in texts as text, whatever they contain.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from string import Formatter
from typing import TYPE_CHECKING, Any
from urllib.parse import quote
from xml.etree import ElementTree

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import read_text, write_text
from sdt_drake.io.shown import aligned, formatted
from sdt_drake.show import sections as doc

if TYPE_CHECKING:  # only commands that write a report need these
    from jinja2 import Environment
    from markdown_it import MarkdownIt
    from matplotlib.figure import Figure

    from sdt_drake.show.panels import Plots, Stored

REPORT, MARKDOWN = "report.html", "report.md"

_MAX_FILE_BYTES = 100_000_000


@dataclass(frozen=True, eq=False)
class Report:
    """A report: title, answer and sections."""

    title: str
    lead: Sequence[doc.Block]
    """The answer, above all sections."""
    sections: Sequence[doc.Section]
    symbols: bool = field(default=False, kw_only=True)
    """Set K_PS and tau_LD as in equations. Off where users' names may have this form."""

    def markdown(self) -> str:
        """Return the report as Markdown."""
        parts = [f"# {doc.marked(self.title)}", *map(_markdown, self.lead)]
        for section in self.sections:
            parts += [f"## {doc.marked(section.title)}", *map(_markdown, section.blocks)]
        return "\n\n".join(parts) + "\n"

    def lines(self) -> list[str]:
        """Return texts and tables as lines of plain text, for the console."""
        found: list[str] = []
        for block in (*self.lead, *(x for section in self.sections for x in section.blocks)):
            if isinstance(block, doc.Table):
                found += ["", *[block.title] * bool(block.title)]
                found += aligned(block.header, block.rows, 1, 100)
            elif isinstance(block, str):
                found += doc.plain(block).splitlines()
        return found

    def page(self, folder: Path) -> str:
        """Return a page that needs no other file and no network.

        Args:
            folder: the folder of the pictures of `write_parts`.

        Raises:
            InputError: if a picture is missing or is not SVG.
        """
        return _Page(folder, self.symbols).html(self)

    def write_parts(self, folder: Path) -> None:
        """Write the pictures and pages that Markdown shows into a folder."""
        for block in _within([*self.lead, *(x for s in self.sections for x in s.blocks)]):
            if isinstance(block, doc.Page) and block.text is not None:
                write_text(folder / block.name, block.text)
            elif isinstance(block, doc.Picture) and block.content is not None:
                _save(block.content, folder / block.name)

    def write(self, folder: Path) -> Path:
        """Write report.md, the page and all parts into a folder, and return the page's path.

        Raises:
            InputError: as for `page`, or if a file cannot be written.
        """
        self.write_parts(folder)
        page = self.page(folder)
        write_text(folder / MARKDOWN, self.markdown())
        return write_text(folder / REPORT, page)


def written(
    name: str, values: Mapping[str, Any], folder: Path = doc.TEMPLATES / "reports", **options: bool
) -> Report:
    """Make the report that name.md in a folder of the package contains.

    A heading of level 1 is the title, each of level 2 begins a section. Braces hold names of
    `values`, as in `said`. A paragraph that is one pair of braces is the block of that name, or
    the list of blocks. A paragraph that is a picture shows the figure or the plots that have its
    name; without them, a file. A line with a value that is None is left out, and so are a block
    that is None or empty, and a section without blocks.

    Args:
        name: name of the Markdown file.
        values: texts, numbers and blocks by name, figures and plots by the names of their files.
        folder: folder of the Markdown file.
        options: options of `Report`.
    """
    chapters: list[tuple[str, list[doc.Block]]] = []
    for text in (folder / f"{name}.md").read_text("utf-8").rstrip().split("\n\n"):
        found: Any = None
        if heading := re.fullmatch("##? (.+)", text):
            chapters.append((doc.said(heading[1], **values), []))
        elif block := re.fullmatch(r"\{(\w+)\}", text):
            found = values[block[1]]
        elif shown := re.fullmatch(r"!\[(.+)\]\((.+)\)", text):
            file = shown[2].format(**values)
            content = values.get(file, file)
            if content:
                caption = doc.said(shown[1], **values)
                found = doc.Picture(file, caption, None if content == file else content)
        else:
            found = "\n".join(line for line in text.split("\n") if _is_said(line, values))
            found = found and doc.said(found, **values)
        chapters[-1][1].extend(found if isinstance(found, list) else [found] * bool(found))
    (title, lead), *sections = chapters
    return Report(title, lead, [doc.Section(*one) for one in sections if one[1]], **options)


def _is_said(line: str, values: Mapping[str, Any]) -> bool:
    """Check if no value of a line is None."""
    names = (re.split(r"[.\[]", name or "")[0] for _, name, *_ in Formatter().parse(line))
    return all(values.get(name, "") is not None for name in names)


def _within(blocks: Iterable[doc.Block]) -> Iterator[doc.Block]:
    """List blocks, with those within boxes."""
    for block in blocks:
        yield block
        if isinstance(block, doc.Box):
            yield from _within(block.blocks)


def _save(content: Figure | Plots | Stored, path: Path) -> None:
    from sdt_drake.show.panels import Plots, Stored, picture
    from sdt_drake.show.style import save, save_both

    if isinstance(content, Plots):
        save(picture("", content.columns), path)
    elif not isinstance(content, Stored):
        save_both(content, path)


def _markdown(block: doc.Block) -> str:
    match block:
        case doc.Table(header, rows, title):
            rule = doc.Marked(" | ".join("---:" if x else "---" for x in block.is_numeric()))
            cells = [doc.joined(header, " | "), rule, *(doc.joined(row, " | ") for row in rows)]
            lines = "\n".join(f"| {row} |" for row in cells)
            return f"### {doc.marked(title)}\n\n{lines}" if title else lines
        case doc.Picture(name, caption):
            return f"![{doc.marked(caption)}]({quote(name)})"
        case doc.Page(name, button):
            return f"[{doc.marked(button)}]({quote(name)})"
        case doc.Box(tag, blocks, attributes, head):
            inner = map(_markdown, blocks)
            return "\n\n".join([f"<{tag}{attributes}>{head}", *inner, f"</{tag}>"])
        case doc.Rows(_, rows):
            titles = [" · ".join([row.cells[-1], *row.cells[:2]]) for row in rows]
            folded = [doc.details(t, *row.blocks) for t, row in zip(titles, rows, strict=True)]
            return "\n\n".join(map(_markdown, folded))
        case _:
            return doc.marked(block)


# --- pages -----------------------------------------------------------------------------------


def html_of(blocks: Iterable[doc.Block]) -> _Html:
    """Return texts and tables as HTML, for a template."""
    return _Html(_Page(Path(), symbols=False).blocks(blocks))


_GREEK = {"omega": "ω", "zeta": "ζ", "tau": "τ"}
_SYMBOL = re.compile(
    r"(?<![A-Za-z_])(?:(omega|zeta|tau|I|K|d)_([A-Za-z0-9]+(?:,(?:max|min|\d)(?![\w]))?)"
    r"|(omega|zeta|tau)(?![A-Za-z_]))"
)


_POSTER = re.compile(r'<img id="sdt-poster"[^>]* src="(data:image/jpeg;base64,[\w+/=]+)"')
_TAG = re.compile(r"<[^<>]*>")
_BREAK = re.compile(r"(?<=[_.])(?=\w)(?![^<>]*>)")  # where a long name may break, not in a tag


class _Html(str):
    """HTML, which templates do not escape."""

    def __html__(self) -> str:
        return self


@dataclass(frozen=True)
class _Page:
    """The HTML of blocks; pictures are files of the folder."""

    folder: Path
    symbols: bool

    @cached_property
    def parser(self) -> MarkdownIt:
        from markdown_it import MarkdownIt

        parser = MarkdownIt("commonmark", {"html": False})
        parser.add_render_rule("text", lambda _, tokens, i, *__: self._text(tokens[i].content))
        return parser

    def html(self, report: Report) -> str:
        names = [self.inline(section.title) for section in report.sections]
        links = [f'<a href="#section-{i}">{name}</a>' for i, name in enumerate(names, 1)]
        sections = [
            f'<section id="section-{i}"><h2>{name}</h2>\n{self.blocks(section.blocks)}</section>'
            for i, (name, section) in enumerate(zip(names, report.sections, strict=True), 1)
        ]
        title, main = self.inline(report.title), "\n".join(sections)
        return render_html(
            "page.html.j2",
            title=_Html(_TAG.sub("", title)),
            head=_Html(f"<h1>{title}</h1>\n{self.blocks(report.lead)}"),
            nav=_Html("\n".join(links)),
            main=_Html(main),
            has_plots='<div class="plots">' in main,
        )

    def blocks(self, blocks: Iterable[doc.Block]) -> str:
        return "".join(map(self.block, blocks))

    def block(self, block: doc.Block) -> str:
        match block:
            case doc.Table():
                return self._table(block)
            case doc.Picture(name, caption, content):
                caption = self.inline(caption)
                if data := getattr(content, "data", None):
                    return _part("plots", caption=_Html(caption), data=data())
                svg = read_svg((self.folder / name).with_suffix(".svg"))
                drawn, alt = base64.b64encode(svg.encode()).decode(), _Html(_TAG.sub("", caption))
                return _part("figure", caption=_Html(caption), alt=alt, data=drawn)
            case doc.Page(name, button, text):
                text = read_text(self.folder / name, _MAX_FILE_BYTES) if text is None else text
                poster = _POSTER.search(text)
                return _part(
                    "embedded",
                    button=_Html(self.inline(button)),
                    text=text,
                    poster=poster and poster[1],
                )
            case doc.Box(tag, blocks, attributes, head):
                return f"<{tag}{attributes}>{head}\n{self.blocks(blocks)}</{tag}>\n"
            case doc.Rows():
                return self._rows(block)
            case _:
                return self.parser.render(doc.marked(block))

    def inline(self, text: str) -> str:
        return self.parser.renderInline(doc.marked(text))

    def _table(self, table: doc.Table) -> str:
        right = ' style="text-align:right"'
        styles = ["", *(right if numeric else "" for numeric in table.is_numeric()[1:])]
        head = [
            f"<th{look}>{_BREAK.sub('<wbr>', self.inline(x))}</th>"
            for x, look in zip(table.header, styles, strict=True)
        ]
        lines = ["<thead>", "<tr>", *head, "</tr>", "</thead>", "<tbody>"]
        for row in table.rows:
            name, *cells = map(self.inline, row)
            values = [f"<td{look}>{x}</td>" for x, look in zip(cells, styles[1:], strict=True)]
            lines += ["<tr>", f'<th scope="row">{name}</th>', *values, "</tr>"]
        title = f"<h3>{self.inline(table.title)}</h3>\n" if table.title else ""
        whole = "\n".join([*lines, "</tbody>"])
        return f'{title}<div class="scroll" tabindex="0"><table>\n{whole}\n</table></div>\n'

    def _rows(self, table: doc.Rows) -> str:
        names = "".join(f"<span>{self.inline(name)}</span>" for name in table.header)
        lines = [f'<div class="rows"><div class="row" aria-hidden="true">{names}</div>']
        for row in table.rows:
            cells = [
                f'<span data-name="{html.escape(name)}"><span>{self.inline(cell)}</span></span>'
                for name, cell in zip(table.header, row.cells, strict=True)
            ]
            cells[-1] = cells[-1].replace("<span>", f'<span class="{row.look}">')
            summary = f'<summary class="row">{"".join(cells)}</summary>'
            verdict = f'data-verdict="{html.escape(row.verdict)}"'
            lines += [f"<details {verdict}>{summary}", self.blocks(row.blocks), "</details>"]
        return "\n".join([*lines, "</div>\n"])

    def _text(self, words: str) -> str:
        text = re.sub(r"\[.{,9}\]", lambda unit: unit[0].replace(" ", "\u00a0"), html.escape(words))
        return _SYMBOL.sub(_symbol, text) if self.symbols else text


def _symbol(match: re.Match[str]) -> str:
    """Return a symbol as HTML with Greek letters and subscripts."""
    letter, index, alone = match.groups()
    if alone:
        return _GREEK[alone]
    return f"{_GREEK.get(letter, letter)}<sub>{index}</sub>"


def read_svg(path: Path) -> str:
    """Read an .svg file that is going to be embedded in a page.

    Raises:
        InputError: if the file is missing or is not SVG.
    """
    if not path.exists():
        raise InputError(f"{path}: is missing")
    text = read_text(path, _MAX_FILE_BYTES)
    try:
        is_svg = ElementTree.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
    except (ElementTree.ParseError, ValueError):
        is_svg = False
    if not is_svg:
        raise InputError(f"{path}: is not an SVG picture")
    return text


# --- HTML templates --------------------------------------------------------------------------


def render_html(template: str, **values: object) -> str:
    """Render an HTML template."""
    return _environment().get_template(template).render(values)


def _part(name: str, **values: Any) -> str:
    return str(getattr(_environment().get_template("parts.html.j2").module, name)(**values))


def _own(name: str) -> str:
    return (doc.TEMPLATES / name).read_text("utf-8")


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(doc.TEMPLATES),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["f"] = formatted
    environment.globals["text"] = lambda name: _Html(_own(name))
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    return environment
