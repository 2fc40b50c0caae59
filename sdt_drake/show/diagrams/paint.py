"""Pages of diagrams drawn by matplotlib."""

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import matplotlib
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.text import Text
from matplotlib.transforms import Affine2D

from sdt_drake.show.diagrams.page import TITLE_X, TITLE_Y, Item, Page, shaft
from sdt_drake.show.diagrams.text import LINE, in_mathtext

PICTURES = ("svg", "png", "pdf")

# Fonts for machines without matplotlib's.
_FAMILY = b"font-family: 'DejaVu Sans', Verdana, sans-serif"
_STYLE = matplotlib.rc_params_from_file(
    Path(__file__).with_name("diagram.mplstyle"), use_default_template=False
)
_BORDER = 4  # around the page [points]
_CAP = 3.6  # from the baseline of a line to its middle [points]
_GRAY = "0.35"


def painted(page: Page, format_: str, *, about: str = "") -> bytes:
    """Return a page as the content of a picture file; equal pages give equal files.

    Args:
        page: the page.
        format_: "svg", "png" or "pdf".
        about: a description that the file contains.
    """
    metadata: dict[str, dict[str, str | None]] = {
        "svg": {"Title": page.title, "Description": about, "Date": None},
        "png": {"Title": page.title, "Description": about},
        "pdf": {"Title": page.title, "Subject": about, "CreationDate": None},
    }
    file = io.BytesIO()
    with matplotlib.rc_context(_STYLE):
        figure(page).savefig(file, format=format_, dpi=144, metadata=metadata[format_])
    content = file.getvalue()
    return re.sub(rb'font-family: [^;"]*', _FAMILY, content) if format_ == "svg" else content


def figure(page: Page) -> Figure:
    """Draw a page as a figure of the same size."""
    size = (page.width + 2 * _BORDER) / 72, (page.height + 2 * _BORDER) / 72  # inch
    sheet = Figure(figsize=size, facecolor="white")
    points = Affine2D().translate(_BORDER, _BORDER).scale(1 / 72) + sheet.dpi_scale_trans
    for artist in _artists(page):
        artist.set_transform(points)
        sheet.add_artist(artist)
    return sheet


def _artists(page: Page) -> Iterator[Artist]:
    for frame in page.frames:
        left, top = frame.x - frame.width / 2, frame.y + frame.height / 2
        yield _box(frame, _GRAY, (0, (5, 3)))
        yield from _lines(frame.text, left + TITLE_X, top - TITLE_Y, _GRAY, "left")
    for _, line in page.wires:
        xs, ys = zip(*shaft(line), strict=True)
        yield Line2D(xs, ys, color="black", linewidth=1, solid_joinstyle="miter")
        yield _head(*shaft(line)[-1], *line[-1])
    for item in page.items:
        if item.shape == "box":
            yield _box(item, "black", "-")
        elif item.shape != "end":
            colour = "black" if item.shape == "dot" else "none"
            middle, radius = (item.x, item.y), item.width / 2
            yield Circle(middle, radius, facecolor=colour, edgecolor="black", gid=item.name)
        yield from _lines(item.text, item.x, item.y)


def _box(item: Item, colour: str, dashes: Any) -> Rectangle:
    corner = item.x - item.width / 2, item.y - item.height / 2
    box = Rectangle(corner, item.width, item.height, facecolor="none", edgecolor=colour)
    box.set(linestyle=dashes, gid=item.name)
    return box


def _head(x: float, y: float, u: float, v: float) -> Polygon:
    """Draw an arrow head from the middle of its base (x, y) to its tip (u, v)."""
    a, b = (v - y) * 0.35, (u - x) * 0.35
    return Polygon([(x - a, y + b), (u, v), (x + a, y - b)], color="black", linewidth=0)


def _lines(
    text: str,
    x: float,
    y: float,
    colour: str = "black",
    align: Literal["left", "center"] = "center",
) -> Iterator[Text]:
    """Draw each line as a text of its own, as .svg files keep these whole."""
    lines = text.split("\n")
    y += (len(lines) - 1) / 2 * LINE - _CAP
    for number, line in enumerate(map(in_mathtext, lines)):
        line_y = y - number * LINE
        yield Text(x, line_y, line, color=colour, horizontalalignment=align, parse_math=True)
