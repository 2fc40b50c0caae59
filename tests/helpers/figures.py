"""What figures show, compared by their numbers and texts."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from PIL import Image


def content_of(png: Path) -> dict:
    """Its numbers and texts, as diagrams/redraw.py writes them into it."""
    return json.loads(Image.open(png).text["Comment"])


def check_same(shown: dict, committed: Path) -> None:
    """A PNG says the same but for numbers, and shows the same: see `check_same_numbers`."""
    expected = content_of(committed)
    for one, other in zip(shown["texts"], expected["texts"], strict=True):
        assert re.sub(r"\d[\d.]*", "#", one) == re.sub(r"\d[\d.]*", "#", other), committed.name
    check_same_numbers(shown["numbers"], expected["numbers"], committed.name)


def check_same_numbers(shown: list, expected: list, name: str) -> None:
    """To 0.2 % of the largest number of each line."""
    assert list(map(len, shown)) == list(map(len, expected)), f"draw {name} again"
    for one, other in zip(shown, expected, strict=True):
        size = np.nanmax(np.abs(other), initial=1e-9)
        np.testing.assert_allclose(one, other, rtol=0, atol=2e-3 * size, err_msg=name)


def unpacked(message: bytes, count: int) -> np.ndarray:
    """The last numbers of a message of Meshcat; a pose has the columns of its matrix."""
    return np.frombuffer(message[-9 * count :], [("type", "u1"), ("number", ">f8")])["number"]


def _legends(figure) -> list:
    return list(filter(None, [*figure.legends, *(ax.get_legend() for ax in figure.axes)]))


# --- a figure as text ------------------------------------------------------------------------


def described(figure) -> str:
    """What a figure shows: texts, units, legends, and few points of all that is drawn.

    Numbers have three digits; those below a millionth of the largest of their kind are 0.
    """
    legend = "legend: " + "; ".join(_handles(figure))
    return "\n\n".join([figure.get_suptitle(), legend, *map(_panel, figure.axes)]) + "\n"


def _handles(figure) -> list[str]:
    return [
        f"{text.get_text()} ({_look(handle)})"
        for legend in _legends(figure)
        for text, handle in zip(legend.get_texts(), legend.legend_handles, strict=True)
    ]


def _panel(ax) -> str:
    titles = [ax.get_title(loc) for loc in ("left", "center", "right")]
    rows = [" | ".join(filter(None, titles)) or "-"]
    for name, axis in (("x", ax.xaxis), ("y", ax.yaxis)):
        scale = axis.get_scale()
        ticks = [x.get_text() for x in axis.get_ticklabels()] if scale == "linear" else []
        named = " ".join(x for x in ticks if re.search("[a-z]", x))
        rows.append(f"{name}: {axis.get_label_text()!r} {scale} {named}".strip())
    rows += [f"line {_called(x)}({_look(x)}) {_points(*x.get_data())}" for x in ax.lines]
    boxes = [x for x in ax.patches if hasattr(x, "get_width")]
    rows += [f"box {_called(x)}({_look(x)}) {_numbers(x.get_bbox().extents)}" for x in boxes[:12]]
    for drawn in ax.collections:
        if len(points := drawn.get_offsets()) and np.any(points):
            told = _points(*np.ma.getdata(points).T)
        else:
            paths = drawn.get_paths()
            told = " & ".join(_numbers(path.get_extents().extents) for path in paths[:6])
        rows.append(f"area {_called(drawn)}({_look(drawn)}) {told}")
    rows += [f"text {x.get_text()!r} at {_numbers(x.get_position())}" for x in ax.texts[:12]]
    return "\n".join(rows)


def _called(drawn) -> str:
    return "" if drawn.get_label().startswith("_child") else f"{drawn.get_label()!r} "


def _look(drawn) -> str:
    if hasattr(drawn, "get_linestyle") and hasattr(drawn, "get_color"):
        colour = drawn.get_color()
        parts = [to_hex(colour if isinstance(colour, str | tuple) else colour[0])]
        if hasattr(drawn, "get_marker"):
            parts += [drawn.get_linestyle(), drawn.get_marker()]
        return " ".join(x for x in parts if x not in ("None", ""))
    faces = np.reshape(drawn.get_facecolor(), (-1, 4))
    return " ".join(dict.fromkeys(to_hex(face) for face in faces)) or "empty"


def _points(x, y) -> str:
    """Seven points, and the least and the largest."""
    x, y = (np.atleast_1d(np.asarray(v, dtype=float)) for v in (x, y))
    some = np.unique(np.linspace(0, len(x) - 1, 7).astype(int)) if len(x) else []
    told = f"x {_numbers(x[some])}; y {_numbers(y[some])}"
    if len(x) > 7 and np.isfinite(y).any():
        told += f"; {_numbers([np.nanmin(y), np.nanmax(y)])}"
    return told


def _numbers(values) -> str:
    values = np.ma.filled(np.ma.asarray(values, dtype=float), np.nan)
    size = np.max(np.abs(values), where=np.isfinite(values), initial=1e-9)
    values = np.where(np.abs(values) < 1e-6 * size, 0.0, values)
    return " ".join(f"{x:.3g}" for x in values)


NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def check_same_text(obtained: Path, expected: Path, share: float = 2e-3) -> None:
    """The same words, and the same numbers but for their last place, or a share of them."""
    new, old = (path.read_text(encoding="utf-8").splitlines() for path in (obtained, expected))
    words = [[" ".join(NUMBER.sub("#", line).split()) for line in lines] for lines in (new, old)]
    assert words[0] == words[1]
    for line, wanted in zip(new, old, strict=True):
        for value, number in zip(NUMBER.findall(line), NUMBER.findall(wanted), strict=True):
            mantissa, _, exponent = number.partition("e")
            place = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
            within = max(1.01 * place * ("." in mantissa), share * abs(float(number)), 1e-6)
            assert float(value) == pytest.approx(float(number), abs=within), line
