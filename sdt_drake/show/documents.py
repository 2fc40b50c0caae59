"""Reports: templates rendered to Markdown, and Markdown rendered to offline pages.

Every printed value passes `escaped`, except `Marked` texts, which this package writes. Pages show
HTML in Markdown as text, except the tags of `_OWN_TAG`; no escaped text contains one.
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
from sdt_drake.io.markdown import escaped
from sdt_drake.io.shown import formatted

if TYPE_CHECKING:  # only commands that write a report need these
    from jinja2 import Environment
    from markdown_it import MarkdownIt
    from markdown_it.token import Token

    from sdt_drake.show.panels import Plots

REPORT, MARKDOWN = "report.html", "report.md"
TEMPLATES = Path(__file__).with_name("templates")

_MAX_FILE_BYTES = 100_000_000


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


@dataclass(frozen=True)
class Report:
    """A rendered report."""

    markdown: str
    folder: Path
    """The folder with the pictures of the report."""
    attached: Mapping[str, Plots | str] = field(default_factory=dict)
    """Plots, and texts of HTML pages, by file name. Markdown links to a picture of the plots."""
    symbols: bool = False
    """Set K_PS and tau_LD as in equations. Off where users' names may have this form."""

    def page(self) -> str:
        """Render a page that needs no other file and no network.

        Raises:
            InputError: if a picture is missing or is not SVG.
        """
        return _Page(self).html()

    def write(self) -> Path:
        """Write report.md and the page into the folder, and return the path of the page.

        Raises:
            InputError: as for `page`, or if a file cannot be written.
        """
        page = self.page()
        write_text(self.folder / MARKDOWN, self.markdown)
        return write_text(self.folder / REPORT, page)


# --- templates -------------------------------------------------------------------------------


class Marked(str):
    """Markdown or HTML written by this package, which is not escaped."""

    def __html__(self) -> str:
        return self


def render(template: str, **values: object) -> str:
    """Render a Markdown template."""
    return _environment(_printed).get_template(template).render(values) + "\n"


def bullets(template: str, **values: object) -> list[str]:
    """Render a Markdown template that is a list, and return its items."""
    return [Marked(line[2:]) for line in render(template, **values).splitlines() if line]


def plain(text: str) -> str:
    """Return a line of Markdown as plain text."""
    return re.sub(r"\*\*|`|\\(?=[^\w\s])", "", text)


def capital(text: str) -> str:
    """Return a text with a capital first letter; the others stay, unlike with `str.capitalize`."""
    return text[:1].upper() + text[1:]


def render_html(template: str, **values: object) -> str:
    """Render an HTML template."""
    return _environment(None).get_template(template).render(values)


def _printed(value: object) -> object:
    return value if hasattr(value, "__html__") else Marked(escaped(value))


def code(value: object) -> Marked:
    """Return a text as inline code, or escaped where Markdown cannot show it as code."""
    text = str(value)
    return Marked(f"`{text}`" if re.fullmatch(r"[^`|\r\n]+", text) else escaped(text))


def _fenced(value: object) -> Marked:
    """Return a text as a fenced code block."""
    fence = max(["```", *(f"{run}`" for run in re.findall("`{3,}", str(value)))], key=len)
    return Marked(f"{fence}\n{value}\n{fence}")


def _summary(value: object) -> Marked:
    """Return a text as the HTML summary of a section that unfolds."""
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
    environment.filters["capital"] = capital
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
    """A renderer of one page."""

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
                tokens[i + 2].tag = "th"  # the closing tag
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
        """Return the HTML of a paragraph that is a single own tag, picture or page; else ""."""
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
        return read_text(self.report.folder / name, _MAX_FILE_BYTES) if text is None else text

    def _text(self, words: str) -> str:
        text = re.sub(r"\[.{,9}\]", lambda unit: unit[0].replace(" ", "\u00a0"), html.escape(words))
        return _SYMBOL.sub(_symbol, text) if self.report.symbols else text


def _words(token: Token) -> str:
    """Return the text of a token without its markup."""
    return "".join(child.content for child in token.children or [])


def _part(name: str, **values: Any) -> str:
    return str(getattr(_environment(None).get_template("parts.html.j2").module, name)(**values))


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
