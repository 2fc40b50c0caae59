"""Reports: a template of Markdown each, rendered to Markdown, and that to a page without a network.

What a template prints passes `escaped`, all but `Marked` texts, which are our own. HTML in Markdown
is off on pages, but for the tags of `_OWN_TAG`: no escaped text has one.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote
from xml.etree import ElementTree

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import read_text, write_text
from sdt_drake.io.shown import formatted

if TYPE_CHECKING:  # only commands that write a report need these
    from jinja2 import Environment
    from markdown_it import MarkdownIt
    from markdown_it.token import Token

    from sdt_drake.show.panels import Plots

REPORT, MARKDOWN = "report.html", "report.md"
TEMPLATES = Path(__file__).with_name("templates")

_MOST_BYTES = 100_000_000  # of a file


@dataclass(frozen=True)
class Table:
    """Cells of texts, as many in each row as in the header; the first of a row names it."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    title: str = ""

    def is_numeric(self) -> list[bool]:
        """Whether all cells of a column are numbers or dashes."""
        columns = zip(*self.rows, strict=True) if self.rows else ([] for _ in self.header)
        return [all(map(_NUMBER.fullmatch, cells)) for cells in columns]


_NUMBER = re.compile(r"[-+−–±∞\d., e%]*")


def spread(
    header: Sequence[str], rows: Sequence[Sequence[str | Sequence[str]]], title: str = ""
) -> Table:
    """A table of cells with a text, or one for each joint: these get a column each."""
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


@dataclass(frozen=True)
class Report:
    """A rendered report.

    Attributes:
        markdown: its text.
        folder: it stands in, with its pictures.
        attached: files that are made for it, by name: plots, whose picture Markdown shows, and the
            text of pages.
        symbols: whether pages show K_PS and tau_LD as in equations; not where inputs of users have
            such names.
    """

    markdown: str
    folder: Path
    attached: Mapping[str, Plots | str] = field(default_factory=dict)
    symbols: bool = False

    def page(self) -> str:
        """A page that needs no other file and no network.

        Raises:
            InputError: naming a picture that is missing or is none.
        """
        return _Page(self).html()

    def write(self) -> Path:
        """Write the report into its folder, as report.md and as a page; the path of the page.

        Raises:
            InputError: as `page`, or for a file that cannot be written.
        """
        page = self.page()
        write_text(self.folder / MARKDOWN, self.markdown)
        return write_text(self.folder / REPORT, page)


# --- templates -------------------------------------------------------------------------------


class Marked(str):
    """Markdown, or on a page HTML, of our own, which is not escaped."""

    def __html__(self) -> str:
        return self


def render(template: str, **values: object) -> str:
    """Render a template of Markdown."""
    return _environment(_printed).get_template(template).render(values) + "\n"


def bullets(template: str, **values: object) -> list[str]:
    """Render a template of a list; its items."""
    return [Marked(line[2:]) for line in render(template, **values).splitlines() if line]


def plain(text: str) -> str:
    """Markdown of a line as one reads it."""
    return re.sub(r"\*\*|`|\\(?=[^\w\s])", "", text)


def render_html(template: str, **values: object) -> str:
    """Render a template of HTML."""
    return _environment(None).get_template(template).render(values)


def _printed(value: object) -> object:
    return value if hasattr(value, "__html__") else Marked(escaped(value))


def escaped(value: object) -> str:
    """Markdown that shows a text, of one line, as it is."""
    text = re.sub(r"\s*[\r\n]\s*", " ", str(value).strip())
    return _SPECIAL.sub(lambda m: m["unit"] or f"{m['number'] or ''}\\{m['mark'] or ''}", text)


_SPECIAL = re.compile(
    r"(?P<unit>\[[\w/²³°%., -]{1,40}\](?![\[(:]))|^(?P<number>\d{1,9})(?=[.)](?:\s|$))"
    r"|(?P<mark>[\\`*|~$\[\]]|(?<![^\W_])_|_(?![^\W_])|<(?=[A-Za-z/!?])|&(?=[#A-Za-z])|(?<!\S)#"
    r"|^>|^[-+=](?=[-+=\s]|$))"
)


def code(value: object) -> Marked:
    """Markdown of a text in a typewriter's letters, where Markdown has it so."""
    text = str(value)
    return Marked(f"`{text}`" if re.fullmatch(r"[^`|\r\n]+", text) else escaped(text))


def _fenced(value: object) -> Marked:
    """Markdown of lines in a typewriter's letters."""
    fence = max(["```", *(f"{run}`" for run in re.findall("`{3,}", str(value)))], key=len)
    return Marked(f"{fence}\n{value}\n{fence}")


def _summary(value: object) -> Marked:
    """The line that one unfolds, in HTML also within Markdown."""
    return Marked(html.escape(" ".join(str(value).split())))


@cache
def _environment(finalize: Callable[[object], object] | None) -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        undefined=StrictUndefined,
        autoescape=True,
        finalize=finalize,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"f": formatted, "code": code, "fenced": _fenced, "summary": _summary}
    environment.globals["text"] = lambda name: Marked((TEMPLATES / name).read_text("utf-8"))
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    return environment


# --- pages -----------------------------------------------------------------------------------

_OWN_TAG = re.compile(
    r"<details><summary>[^<>]*</summary>|</details>"
    r'|</?(?:div|article)(?: (?:class|data-verdict)="[a-z ]*")*>'
)
_GREEK = {"omega": "ω", "zeta": "ζ", "tau": "τ"}
_SYMBOL = re.compile(
    r"(?<![A-Za-z_])(?:(omega|zeta|tau|I|K|d)_([A-Za-z0-9]+(?:,(?:max|min|\d)(?![\w]))?)"
    r"|(omega|zeta|tau)(?![A-Za-z_]))"
)


class _Page:
    """A page in the making."""

    def __init__(self, report: Report) -> None:
        from markdown_it import MarkdownIt

        self.report = report
        self.parser: MarkdownIt = MarkdownIt("commonmark", {"html": False}).enable("table")
        for name, rule in {
            "table_open": lambda *_: '<div class="scroll" tabindex="0"><table>',
            "table_close": lambda *_: "</table></div>",
            "text": lambda _, tokens, i, *__: self._text(tokens[i].content),
        }.items():
            self.parser.add_render_rule(name, rule)

    def html(self) -> str:
        tokens = self.parser.parse(self.report.markdown)
        for i, (before, token) in enumerate(pairwise(tokens), start=1):
            if before.type == "paragraph_open" and (block := self._block(token)):
                before.hidden = tokens[i + 1].hidden = True
                token.type, token.content = "html_block", block
            if before.type == "tr_open" and token.type == "td_open":
                token.tag, token.attrs["scope"] = "th", "row"
                tokens[i + 2].tag = "th"  # its end, after what is in it
        chapters = [i for i, x in enumerate(tokens) if (x.type, x.tag) == ("heading_open", "h2")]
        head, *sections = (
            self._html(tokens[i:k]) for i, k in pairwise([0, *chapters, len(tokens)])
        )
        return render_html(
            "page.html.j2",
            title=_words(tokens[1]),
            head=head,
            titles=[self._html([tokens[i + 1]]) for i in chapters],
            sections=sections,
            has_plots=any(not isinstance(file, str) for file in self.report.attached.values()),
        )

    def _html(self, tokens: Sequence[Token]) -> Marked:
        return Marked(self.parser.renderer.render(tokens, self.parser.options, {}))

    def _block(self, token: Token) -> str:
        """The HTML of a paragraph that is one of our tags, a picture or a page alone; or ""."""
        if _OWN_TAG.fullmatch(token.content):
            return token.content
        match [(child.type, child) for child in token.children or []]:
            case [("image", image)]:
                return self._figure(image, str(image.attrs["src"]))
            case [("link_open", link), ("text", words), ("link_close", _)]:
                text = self._page_text(unquote(str(link.attrs["href"])))
                return _part("embedded", button=words.content, text=text)
        return ""

    def _figure(self, image: Token, name: str) -> str:
        name, caption = unquote(name), self._html(image.children or [])
        plots = self.report.attached.get(name)
        if plots is not None and not isinstance(plots, str):
            return _part("plots", caption=caption, data=plots.data())
        svg = read_svg((self.report.folder / name).with_suffix(".svg"))
        data = base64.b64encode(svg.encode()).decode()
        return _part("figure", caption=caption, alt=_words(image), data=data)

    def _page_text(self, name: str) -> object:
        text = self.report.attached.get(name)
        return read_text(self.report.folder / name, _MOST_BYTES) if text is None else text

    def _text(self, words: str) -> str:
        text = re.sub(r"\[.{,9}\]", lambda unit: unit[0].replace(" ", "\u00a0"), html.escape(words))
        return _SYMBOL.sub(_symbol, text) if self.report.symbols else text


def _words(token: Token) -> str:
    """The text alone."""
    return "".join(child.content for child in token.children or [])


def _part(name: str, **values: Any) -> str:
    return str(getattr(_environment(None).get_template("parts.html.j2").module, name)(**values))


def _symbol(match: re.Match[str]) -> str:
    """As it is printed in an equation."""
    letter, index, alone = match.groups()
    if alone:
        return _GREEK[alone]
    return f"{_GREEK.get(letter, letter)}<sub>{index}</sub>"


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
