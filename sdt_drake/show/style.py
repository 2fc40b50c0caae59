"""Colours, axes, titles and legends of all figures, and their files and windows."""

import io
import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

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
from sdt_drake.run.options import canonical

# Okabe and Ito, "Color universal design", 2008: colours that colour-blind people can distinguish.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")

_LOOK = Path(__file__).with_name("templates") / "figures.mplstyle"
_STYLE = matplotlib.rc_params_from_file(_LOOK, use_default_template=False)
_FILE_BACKENDS = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")
_LEGEND_ROW = 0.2  # height [inch]
_Figure = TypeVar("_Figure", bound=Figure)
_MIN_PLAIN = 3e-3  # axes with smaller values have a power of ten in their unit


Dashes = Literal["-", "--", "-.", ":"]


class Look(NamedTuple):
    """The colour, dashes and marker of a line or group."""

    colour: str
    dashes: Dashes = "-"
    marker: str = "o"


LOOKS = {
    "reference": Look(PALETTE[0]),
    "pi": Look(PALETTE[1]),
    "pi_ctc": Look(PALETTE[2], "--", "s"),
    "pi_ctc, printed sign": Look(PALETTE[3], ":", "*"),
    "pi_dob": Look("#117733", "-.", "v"),
    "pi_id": Look(PALETTE[4], "-.", "^"),
    "p_pi": Look(PALETTE[5], "-", "D"),
    "p_pi+ctc": Look("#882255", "--", "v"),
    "p_pi+id": Look(PALETTE[6], ":", "P"),
    "pi_scheduled": Look(PALETTE[7], "-", "X"),
    "pi_scheduled+ctc": Look("#999933", "--", "X"),
    "pi_scheduled+id": Look("#AA4499", "-.", "X"),
    "inverse_dynamics": Look("#332288", "-.", "*"),
}
"""The looks of the reference and of each controller, the same in all figures.

The reference is blue, PI red and PI + CTC green, as in the paper. In figures of one run, blue is
also what was measured, red what was achieved, identified or simulated, green an error or a
sensation, black the torque of a motor, and grey a limit."""

_DASHES: tuple[Dashes, ...] = ("-", "--", "-.", ":")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


def nth_look(i: int) -> Look:
    """Return the look of group i, for groups without fixed looks, such as joints."""
    return Look(PALETTE[i % len(PALETTE)], _DASHES[i % 4], _MARKERS[i % len(_MARKERS)])


def looks_of(labels: Sequence[str]) -> list[Look]:
    """Return a look for each label: the fixed one of a controller, else one in a free colour.

    >>> [look.colour for look in looks_of(["pi", "my controller"])]
    ['#D55E00', '#0072B2']
    """
    labels = list(map(canonical, labels))
    taken = {LOOKS[label].colour for label in labels if label in LOOKS}
    looks = list(map(nth_look, range(len(PALETTE))))
    free = cycle([look for look in looks if look.colour not in taken] or looks)
    return [LOOKS[label] if label in LOOKS else next(free) for label in labels]


class Picture(Figure):
    """A figure that a notebook shows without `%matplotlib inline`."""

    columns: Sequence[Sequence[Any]] = ()
    """The panels that were drawn, by which a page shows the figure with zoom."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        with style():
            self.savefig(buffer, format="png", dpi=100)
        return buffer.getvalue()


@contextmanager
def style() -> Iterator[None]:
    """Draw with the look of this package, within a `with` statement.

    Letters that no font of the machine contains are drawn as boxes, without a warning.
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
    right: float = 0.15,
    bottom: float = 0.85,
    top: float = 0.65,
    sharex: bool | Literal["col"] = True,
) -> tuple[Picture, NDArray[np.object_]]:
    """Make a figure and its axes, shape (rows, columns).

    All sizes are fixed [inch]: matplotlib's automatic layout takes a second.

    Args:
        rows: number of rows.
        columns: number of columns.
        panel: width and height of a panel.
        gaps: horizontal and vertical gap between panels.
        left: left margin of the figure.
        right: right margin.
        bottom: bottom margin.
        top: top margin.
        sharex: as in `matplotlib.figure.Figure.subplots`.
    """
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


def finish(figure: _Figure, title: str, handles: Sequence[Artist] | None = None) -> _Figure:
    """Add a title above a figure and a legend below it, and return the figure.

    A legend of several rows makes the figure higher.

    Args:
        figure: the figure.
        title: the title.
        handles: entries of the legend; by default all lines and areas with a label.
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
        wide = sum(0.6 + 0.068 * len(label) for label in labels)  # inch, estimated
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
    """Label small values in powers of ten of their unit.

    Long numbers have no room beside a panel, and matplotlib's own exponent covers the title.
    """
    largest, label = np.abs(ax.get_ylim()).max(), ax.get_ylabel()
    is_plain = isinstance(ax.yaxis.get_major_formatter(), ScalarFormatter) and "[" in label
    if is_plain and 0 < largest < _MIN_PLAIN:
        exponent = math.floor(math.log10(largest))
        ax.yaxis.set_major_formatter(
            FuncFormatter(lambda value, _: formatted(value / 10**exponent, ".4g").replace("-", "−"))
        )
        ax.set_ylabel(label.replace("[", f"[1e{exponent} ".replace("-", "−")))


def joint_title(k: int, name: str) -> str:
    """Return the title of joint k, counted from 0; `name` may be "".

    >>> joint_title(0, "yaw")
    'joint 1, yaw'
    """
    return f"joint {k + 1}, {name}" if name else f"joint {k + 1}"


def plain_numbers(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers; matplotlib's TeX is off here."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


# --- files and windows -----------------------------------------------------------------------


def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure in the format of its suffix; an existing file is replaced whole.

    Raises:
        InputError: if the suffix is none of FIGURES.
    """
    path = Path(path)
    if path.suffix not in FIGURES:
        raise InputError(f"{path}: unknown kind of figure, expected {', '.join(FIGURES)}")
    metadata = {"Date": None} if path.suffix == ".svg" else None
    whole = io.BytesIO()  # matplotlib does not report a full disk properly
    with style():
        figure.savefig(whole, format=path.suffix[1:], metadata=metadata)
    with replacing(path) as partial:
        partial.write_bytes(whole.getvalue())
    return path


def save_both(figure: Figure, path: Path) -> Path:
    """Write a figure as .png and, for pages, as .svg; return the path of the .svg."""
    save(figure, path.with_suffix(".png"))
    return save(figure, path.with_suffix(".svg"))


def pictures(*names: str) -> list[str]:
    """List the names of the files that `save_both` writes."""
    return [f"{name}{suffix}" for name in names for suffix in (".png", ".svg")]


def check_screen(where: str) -> None:
    """Check that figures can be shown on a screen.

    Raises:
        InputError: if there is no screen; the message begins with `where`.
    """
    import matplotlib.pyplot as plt

    backend = matplotlib.get_backend()  # the best one, or that of $MPLBACKEND
    try:
        plt.switch_backend(backend)
        screen = backend.lower() not in _FILE_BACKENDS
    except ImportError:
        screen = False
    if not screen:
        raise InputError(
            f"{where}: no screen to draw on (matplotlib's backend is {backend}); write the figure "
            "to a file"
        )


def show(figure: Figure) -> None:
    """Open a figure in a window and wait until it is closed; see `check_screen`."""
    import matplotlib.pyplot as plt

    # Only pyplot opens windows, and only for its own figures: replace the figure of an empty one.
    canvas = plt.figure(figsize=figure.get_size_inches()).canvas
    canvas.figure = figure
    figure.set_canvas(canvas)
    plt.show(block=True)
    plt.close("all")
