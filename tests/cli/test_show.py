"""--show and --out: figures on the screen and in files, and one line where there is no screen."""

import io
import os

import matplotlib.pyplot as plt
import pytest
from helpers import window
from helpers.command_line import FIGURE, WRITERS, program, refused
from rich.console import Console

from sdt_drake.cli.printing import Bar

FIGURES = {name: about for name, (about, _) in WRITERS.items() if name != "diagram"}


@pytest.fixture
def screen():
    """The list of the figures that were shown, on a screen whose windows are a list."""
    plt.switch_backend("module://helpers.window")
    window.shown.clear()
    yield window.shown
    plt.switch_backend("agg")


def test_show_and_out_draw_the_same_figure(screen, good, desk):
    out = good("tune", *FIGURES["tune"], "--show", "--out", "new/figure.pdf").out
    assert out.splitlines()[-1] == "new/figure.pdf written"
    (path,) = (desk / "new").iterdir()
    assert path.read_bytes().startswith(FIGURE["pdf"]) and path.stat().st_size > 5_000
    (figure,) = screen
    assert figure.axes[0].get_lines() and plt.get_fignums() == []


@pytest.mark.parametrize("name", FIGURES)
def test_show_without_screen_is_refused_before_computing(refuse, name):
    refuse(name, *FIGURES[name], "--show", "--out", "figure.png", saying=["--show: no screen"])


def test_missing_backend_matters_only_to_show(good, monkeypatch):
    """A notebook leaves one, for example."""
    monkeypatch.setenv("MPLBACKEND", "nonsense")
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    refused(program("step", "--show"), "$MPLBACKEND")
    good("step")
    assert os.environ["MPLBACKEND"] == "agg"


# --- how far long work is --------------------------------------------------------------------


def test_progress_bar_comes_late_and_is_erased():
    terminal = io.StringIO()
    console = Console(file=terminal, force_terminal=True, width=80)
    Bar(console).report(0.1)
    assert terminal.getvalue() == ""  # a command of 2 s needs none
    bar = Bar(console, delay=-1.0)
    bar.report(0.25, "3 of 12 runs")
    assert " 25%" in terminal.getvalue() and "3 of 12 runs" in terminal.getvalue()
    bar.end()
    assert terminal.getvalue().endswith("\x1b[2K")  # the line is wiped out
