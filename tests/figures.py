"""What figures show, compared by their numbers and texts."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
from PIL import Image


def content_of(png: Path) -> dict:
    """Its numbers and texts, as diagrams/redraw.py writes them into it."""
    return json.loads(Image.open(png).text["Comment"])


def check_same(drawn: Path, committed: Path) -> None:
    """Two PNG say the same but for numbers, and show the same: see `check_same_numbers`."""
    shown, expected = map(content_of, (drawn, committed))
    for one, other in zip(shown["texts"], expected["texts"], strict=True):
        assert re.sub(r"\d[\d.]*", "#", one) == re.sub(r"\d[\d.]*", "#", other), committed.name
    check_same_numbers(shown["numbers"], expected["numbers"], committed.name)


def check_same_numbers(shown: list, expected: list, name: str) -> None:
    """To 0.2 % of the largest number of each line."""
    assert list(map(len, shown)) == list(map(len, expected)), f"draw {name} again"
    for one, other in zip(shown, expected, strict=True):
        size = np.nanmax(np.abs(other), initial=1e-9)
        np.testing.assert_allclose(one, other, rtol=0, atol=2e-3 * size, err_msg=name)


def line(ax, label):
    """The one line of that label."""
    (found,) = [line for line in ax.get_lines() if line.get_label() == label]
    return found


def legend_texts(figure) -> list[str]:
    """Of all legends of a figure."""
    legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes)]
    return [text.get_text() for legend in legends if legend for text in legend.get_texts()]


def shown_ticks(axis) -> set[str]:
    """Texts of the ticks that are within the limits."""
    low, high = axis.get_view_interval()
    at = axis.axis_name == "y"
    return {x.get_text() for x in axis.get_ticklabels() if low <= x.get_position()[at] <= high}
