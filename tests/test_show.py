"""--show: figures on the screen, and one line where there is none."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from types import ModuleType

import matplotlib
import matplotlib.pyplot as plt
import pytest
from matplotlib.backend_bases import FigureManagerBase
from matplotlib.backends.backend_agg import FigureCanvasAgg

from sdt_drake.cli import main

AXIS = "package://sdt/scenarios/axis_pi.yaml"
COMMANDS = {
    "tune": [],
    "step": [],
    "simulate": [AXIS],
    "compare": [AXIS, "--controllers", "pi"],
    "bode": [AXIS],
    "budget": [AXIS],
    "stability": ["package://sdt/scenarios/coupled_pi.yaml"],
}


@pytest.fixture
def screen(monkeypatch):
    """A backend with windows; the list of the figures that were shown in them."""
    shown = []

    class Manager(FigureManagerBase):
        @classmethod
        def pyplot_show(cls, *, block=None):
            assert block
            shown.extend(plt.figure(number).canvas.figure for number in plt.get_fignums())

    class Canvas(FigureCanvasAgg):
        manager_class = Manager

    backend = ModuleType("screen_of_the_test")
    backend.FigureCanvas, backend.FigureManager = Canvas, Manager
    monkeypatch.setitem(sys.modules, backend.__name__, backend)
    matplotlib.use(f"module://{backend.__name__}")
    yield shown
    matplotlib.use("Agg")


@pytest.mark.parametrize("command", COMMANDS)
def test_show_opens_the_figure_of_each_command(screen, capsys, command):
    assert main([command, *COMMANDS[command], "--show"]) == 0
    (figure,) = screen
    assert figure.axes[0].get_lines() or figure.axes[0].patches
    assert "written" not in capsys.readouterr().out
    assert plt.get_fignums() == []


def test_show_and_out_do_both(screen, capsys, tmp_path):
    assert main(["step", "--show", "--out", str(tmp_path / "step.png")]) == 0
    assert len(screen) == 1
    assert (tmp_path / "step.png").read_bytes().startswith(b"\x89PNG")
    assert "step.png written" in capsys.readouterr().out


def test_show_beside_a_table(screen, tmp_path):
    assert main(["bode", AXIS, "--show", "--out", str(tmp_path / "bode.csv")]) == 0
    assert len(screen) == 1
    assert (tmp_path / "bode.csv").read_text(encoding="utf-8").startswith("omega")


@pytest.mark.parametrize("command", COMMANDS)
def test_without_a_screen_nothing_is_computed(capsys, tmp_path, command):
    out = tmp_path / "figure.png"
    assert main([command, *COMMANDS[command], "--show", "--out", str(out)]) == 2
    done = capsys.readouterr()
    assert done.out == "" and not out.exists()
    assert re.fullmatch(r"sdt-drake: --show: no screen .* --out\n", done.err)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no $DISPLAY")
def test_a_display_that_is_not_there_is_no_screen(tmp_path):
    """Even with a graphical backend asked for; and it does not hang."""
    environment = {k: v for k, v in os.environ.items() if k != "WAYLAND_DISPLAY"}
    done = subprocess.run(
        [sys.executable, "-m", "sdt_drake", "step", "--show"],
        env={**environment, "MPLBACKEND": "TkAgg", "DISPLAY": ":99"},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.count("\n") == 1 and "--show: no screen" in done.stderr
