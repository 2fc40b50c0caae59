"""The one look of all figures: colours, axes, titles, legends; and files and windows for them."""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from typing import Any, Literal, NamedTuple

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter, ScalarFormatter
from numpy.typing import NDArray

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import replacing
from sdt_drake.io.formats import FIGURES
from sdt_drake.io.shown import formatted

# Okabe and Ito, "Color universal design", 2008: colours that colour-blind people can tell apart.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")

_STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "lines.linewidth": 1.1,
    "text.parse_math": False,  # names are the user's, and no TeX
    "savefig.dpi": 130,
    "svg.hashsalt": "sdt_drake",  # the same figure gives the same file
}
# matplotlib's backends that write files only.
_PAPER = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")


_LEGEND_ROW = 0.2  # inch
_SMALL = 3e-3  # numbers below it are counted in powers of ten


Dashes = Literal["-", "--", "-.", ":"]


class Look(NamedTuple):
    """How a line, and the group that it belongs to, is drawn."""

    colour: str
    dashes: Dashes = "-"
    marker: str = "o"


LOOKS = {
    "reference": Look(PALETTE[0]),
    "pi": Look(PALETTE[1]),
    "pi_ctc": Look(PALETTE[2], "--", "s"),
    "pi_ctc, printed sign": Look(PALETTE[3], ":", "*"),
    "pi_id": Look(PALETTE[4], "-.", "^"),
    "p_pi": Look(PALETTE[5], "-", "D"),
    "p_pi+ctc": Look("#882255", "--", "v"),
    "p_pi+id": Look(PALETTE[6], ":", "P"),
    "pi_scheduled": Look(PALETTE[7], "-", "X"),
    "pi_scheduled+ctc": Look("#999933", "--", "X"),
    "pi_scheduled+id": Look("#AA4499", "-.", "X"),
    "inverse_dynamics": Look("#332288", "-.", "*"),
}
"""Of the reference and of each controller, the same in all figures. What the paper draws in blue,
red and green keeps these hues as far as the palette has them."""

_DASHES: tuple[Dashes, ...] = ("-", "--", "-.", ":")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


def nth_look(i: int) -> Look:
    """The look of group i, of groups that have no order of their own such as joints."""
    return Look(PALETTE[i % len(PALETTE)], _DASHES[i % 4], _MARKERS[i % len(_MARKERS)])


def looks_of(labels: Sequence[str]) -> list[Look]:
    """A look for each label: that of its controller; for others, in their order, one in a colour
    that no controller has there."""
    taken = {LOOKS[label].colour for label in labels if label in LOOKS}
    looks = list(map(nth_look, range(len(PALETTE))))
    free = cycle([look for look in looks if look.colour not in taken] or looks)
    return [LOOKS[label] if label in LOOKS else next(free) for label in labels]


class Picture(Figure):
    """A figure that a notebook shows without a backend for it (`%matplotlib inline`)."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        with style():
            self.savefig(buffer, format="png", dpi=100)
        return buffer.getvalue()


@contextmanager
def style() -> Iterator[None]:
    """The look of all figures of this package.

    Letters that no font of the machine has, as of users' names, are drawn as boxes, without a word.
    """
    with matplotlib.rc_context(_STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from", UserWarning)
        yield


def grid(
    rows: int,
    columns: int,
    *,
    panel: tuple[float, float],
    gaps: tuple[float, float] = (0.35, 0.35),
    left: float = 0.8,
    bottom: float = 0.85,
    top: float = 0.65,
    sharex: bool | Literal["col"] = True,
) -> tuple[Figure, NDArray[np.object_]]:
    """A figure and its axes, shape (rows, columns).

    All sizes are fixed [inch]: computing them takes matplotlib a second.

    Args:
        rows, columns: of the panels.
        panel: width and height of each.
        gaps: between them, across and down.
        left, bottom, top: margins of the figure.
        sharex: as in `matplotlib.figure.Figure.subplots`.
    """
    right = 0.15
    width = left + columns * panel[0] + (columns - 1) * gaps[0] + right
    height = top + rows * panel[1] + (rows - 1) * gaps[1] + bottom
    figure = Picture(figsize=(max(width, 6.5), height))
    axes = figure.subplots(
        rows,
        columns,
        sharex=sharex,
        squeeze=False,
        gridspec_kw={
            "left": left / width,
            "right": 1 - right / width,
            "top": 1 - top / height,
            "bottom": bottom / height,
            "wspace": gaps[0] / panel[0],
            "hspace": gaps[1] / panel[1],
        },
    )
    return figure, axes


def finish(figure: Figure, title: str, handles: Sequence[Artist] | None = None) -> Figure:
    """Put the title above a figure, and a legend below it, by default of all lines and areas that
    have a label; return the figure.

    It grows by what the legend has beyond one row.
    """
    for ax in figure.axes:
        _shorten(ax)
    if handles is None:
        by_label: dict[str, Artist] = {}
        for ax in figure.axes:
            for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
                by_label.setdefault(label, handle)
        labels, handles = list(by_label), list(by_label.values())
    else:
        labels = [str(handle.get_label()) for handle in handles]
    if handles:
        # About as wide as its entries are side by side [inch].
        wide = sum(0.6 + 0.068 * len(label) for label in labels)
        rows = math.ceil(wide / figure.get_figwidth())
        columns = math.ceil(len(labels) / rows)
        _grow_below(figure, (rows - 1) * _LEGEND_ROW)
        figure.legend(handles, labels, loc="lower center", ncols=columns)
    figure.suptitle(title, y=1 - 0.12 / figure.get_figheight(), verticalalignment="top")
    return figure


def _grow_below(figure: Figure, inches: float) -> None:
    before = figure.get_figheight()
    after = before + inches
    figure.set_figheight(after)
    for ax in figure.axes if inches else ():
        box = ax.get_position()
        place = (box.x0, (box.y0 * before + inches) / after, box.width, box.height * before / after)
        ax.set_position(place)


def _shorten(ax: Axes) -> None:
    """Count small numbers in powers of ten of their unit: longer ones have no room beside a panel,
    and matplotlib's own power of ten stands where its title is."""
    largest, label = np.abs(ax.get_ylim()).max(), ax.get_ylabel()
    is_plain = isinstance(ax.yaxis.get_major_formatter(), ScalarFormatter) and "[" in label
    if is_plain and 0 < largest < _SMALL:
        exponent = math.floor(math.log10(largest))
        ax.yaxis.set_major_formatter(
            FuncFormatter(lambda value, _: formatted(value / 10**exponent, ".4g").replace("-", "−"))
        )
        ax.set_ylabel(label.replace("[", f"[1e{exponent} ".replace("-", "−")))


def joint_title(k: int, name: str) -> str:
    """Title of a panel or a line of joint k, from 0, whose name may not be known."""
    return f"joint {k + 1}, {name}" if name else f"joint {k + 1}"


def plain_numbers(axis: Axis) -> None:
    """Powers of ten as numbers: matplotlib would write them in TeX, which is off here."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


# --- files and windows -----------------------------------------------------------------------


def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure; the suffix chooses the format. A file that exists is replaced whole.

    Raises:
        InputError: for another suffix than those of FIGURES.
    """
    path = Path(path)
    if path.suffix not in FIGURES:
        raise InputError(f"{path}: unknown kind of figure, expected {', '.join(FIGURES)}")
    metadata = {"Date": None} if path.suffix == ".svg" else None
    whole = io.BytesIO()  # on a full disk matplotlib stumbles over what it could not write
    with style():
        figure.savefig(whole, format=path.suffix[1:], metadata=metadata)
    with replacing(path) as partial:
        partial.write_bytes(whole.getvalue())
    return path


def save_both(figure: Figure, path: Path) -> Path:
    """Write a figure as .png, to look at, and as .svg, for pages; the path of the latter."""
    save(figure, path.with_suffix(".png"))
    return save(figure, path.with_suffix(".svg"))


def pictures(*names: str) -> list[str]:
    """List the names of the files that `save_both` writes."""
    return [f"{name}{suffix}" for name in names for suffix in (".png", ".svg")]


def check_screen(where: str) -> None:
    """Refuse to show figures where there is no screen.

    Raises:
        InputError: naming `where`.
    """
    import matplotlib.pyplot as plt

    backend = matplotlib.get_backend()  # the best there is, unless $MPLBACKEND says which
    try:
        plt.switch_backend(backend)
        screen = backend.lower() not in _PAPER
    except ImportError:
        screen = False
    if not screen:
        raise InputError(
            f"{where}: no screen to draw on (matplotlib's backend is {backend}); write the figure "
            "to a file with --out"
        )


def show(figure: Figure) -> None:
    """Open a figure in a window; returns when that is closed. See `check_screen`."""
    import matplotlib.pyplot as plt

    # Only pyplot has windows, and only figures of its own: ours takes the place of an empty one.
    canvas = plt.figure(figsize=figure.get_size_inches()).canvas
    canvas.figure = figure
    figure.set_canvas(canvas)
    plt.show(block=True)
    plt.close("all")
