"""Styles of figures, and the scope of a run."""

import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from helpers.command_line import FIGURE

from sdt_drake.io.errors import InputError
from sdt_drake.run.simulate import simulate
from sdt_drake.show.figures.scope import joint_columns
from sdt_drake.show.panels import Plots
from sdt_drake.show.sections import TEMPLATES
from sdt_drake.show.style import LOOKS, PALETTE, finish, grid, save, style

# Machado, Oliveira, Fernandes, "A physiologically-based model for simulation of color vision
# deficiency", 2009: linear RGB as seen without red, green, blue cones.
NO_CONES = {
    "none": np.eye(3),
    "red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998]],
    "green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
              [-0.011820, 0.042940, 0.968881]],
    "blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
             [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


def lab(colour, seen_by):
    """CIE L*a*b* of an sRGB colour (D65), as the eye `seen_by` sees it."""
    rgb = np.array(matplotlib.colors.to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    linear = np.clip(np.array(seen_by) @ linear, 0, 1)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    t = np.array(to_xyz) @ linear / [0.9505, 1.0, 1.089]
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("eye", NO_CONES)
def test_colours_of_one_panel_differ_for_colour_blind_eyes(eye):
    """A difference of 2.3 is just noticeable side by side; lines need many times that."""
    in_time_plots = [LOOKS[label].colour for label in ("reference", "pi", "pi_ctc", "pi_id")]
    for first, second in [*combinations(PALETTE[:5], 2), *combinations(in_time_plots, 2)]:
        seen = [lab(colour, NO_CONES[eye]) for colour in (first, second)]
        assert np.linalg.norm(seen[0] - seen[1]) > 15, (first, second)


def test_figures_pages_and_site_have_one_typeface():
    root = Path(__file__).parents[2]
    styles = [TEMPLATES / "page.css", TEMPLATES / "viewer.css"]
    styles.append(root / ".github/docs/pages/assets/site.css")
    with style():
        (family,) = matplotlib.rcParams["font.family"]
    assert all(
        f'"{family}", "Bitstream Vera Sans", Verdana' in x.read_text("utf-8") for x in styles
    )


def test_missing_glyphs_give_no_warning(tmp_path, recwarn):
    with style():
        figure, axes = grid(1, 1, panel=(4, 2))
        axes[0, 0].plot([0.0, 1.0, 2.0], [3.0, 4.0, 5.0], label="$x^{$")
        finish(figure, "cost in $")
        finish(figure, "滚\U000105c0")
    save(figure, tmp_path / "x.png")
    assert [str(warning.message) for warning in recwarn] == []


@pytest.fixture
def figure():
    with style():
        figure, axes = grid(1, 1, panel=(4, 2))
        axes[0, 0].plot([0.0, 1.0, 2.0], [3.0, 4.0, 5.0])
    return figure


@pytest.mark.parametrize("suffix", FIGURE)
def test_save_writes_what_the_suffix_says_and_the_same_again(figure, tmp_path, suffix):
    before = dict(matplotlib.rcParams)
    path, other = (tmp_path / "new" / f"{name}.{suffix}" for name in "ab")
    assert save(figure, str(path)) == path
    content = path.read_bytes()
    assert content.startswith(FIGURE[suffix]) and [*path.parent.iterdir()] == [path]
    assert save(figure, other).read_bytes() == content or suffix == "pdf"  # it has its date
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize("name", ["figure.xyz", "figure", "figure.csv", ".png"])
def test_save_refuses_another_suffix_and_writes_nothing(figure, tmp_path, name):
    with pytest.raises(InputError, match=re.escape(f"{tmp_path / name}: ") + ".*\\.png") as caught:
        save(figure, tmp_path / name)
    assert "\n" not in str(caught.value) and [*tmp_path.iterdir()] == []


# --- the scope of a run ----------------------------------------------------------------------

DRIVE = {"drive.n1": [150.0, 0.5, 0.05, 0.05], "drive.n0": [300.0, 4.0, 0.5, 0.5]}
DRIVE |= {"drive.reference_delay": 0.0075}


def test_single_saturated_period_is_seen(designed):
    design = designed("axis_pi", DRIVE, start=8.9, end=9.5, rest=20)
    recording = simulate(design)
    once = np.zeros_like(recording.saturated)
    once[5, 1] = 0.1  # in the period that ends there
    _, (speed, *_), *_ = joint_columns(replace(recording, saturated=once), design)
    assert speed.spans() == [(recording.time[4], recording.time[5])]
    (sent,) = Plots([[speed]]).data()["panels"]
    assert sent["marked"] == speed.spans() and sent["title"] == speed.title
