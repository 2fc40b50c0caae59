"""The tutorial notebook: seventeen cells that run, and a choice that their numbers support."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from sdt_drake.show.style import Picture
from sdt_drake.show.view3d.viewer import Animation

NOTEBOOK = Path(__file__).parents[1] / "diagrams" / "tutorial.ipynb"
CELLS = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
CODE = [cell for cell in CELLS if cell["cell_type"] == "code"]


@pytest.fixture(scope="module")
def ran():
    """The names after all cells, what the cells print, and the figures that they end with."""
    names: dict[str, object] = {}
    printed: list[str] = []
    shown: list[object] = []
    names["print"] = lambda *texts: printed.append(" ".join(map(str, texts)))
    for cell in CODE:
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, NOTEBOOK.name, "exec"), names)
        if last:
            shown.append(eval(compile(ast.Expression(last.value), NOTEBOOK.name, "eval"), names))
    return names, printed, shown


def test_seventeen_cells_with_words_before_each():
    assert [cell["cell_type"] for cell in CELLS] == ["markdown", "code"] * 17
    for k, cell in enumerate(CELLS[::2], start=1):
        assert f"## {k}. " in "".join(cell["source"])


def test_stored_outputs_are_those_of_today(ran):
    _, printed, _ = ran
    outputs = [output for cell in CODE for output in cell["outputs"]]
    stored = "".join("".join(output.get("text", [])) for output in outputs)
    number = re.compile(r"[-+]?\d+\.?\d*")
    today = "\n".join(printed) + "\n"

    assert number.sub("", stored).split() == number.sub("", today).split()
    values = [[float(x) for x in number.findall(text)] for text in (stored, today)]
    np.testing.assert_allclose(values[0], values[1], rtol=0.02, atol=0.02)
    pictures = [output["data"].get("image/png", "") for output in outputs if "data" in output]
    assert len(list(filter(None, pictures))) == 11
    assert max(map(len, pictures)) < 300_000


def test_cells_show_figures_and_print_numbers(ran):
    _, printed, shown = ran
    figures = [item for item in shown if isinstance(item, Figure)]

    assert len(figures) == 11
    assert all(isinstance(figure, Picture) for figure in figures)
    # One stands for all: with no backend, and no magic word.
    assert figures[0]._repr_png_().startswith(b"\x89PNG")
    (scene,) = [item for item in shown if isinstance(item, Animation)]
    page = scene._repr_html_()
    assert page.startswith("<iframe ") and "srcdoc=" in page and page.count("<") == 2
    assert len(printed) > 15 and "nan" not in " ".join(printed)


def test_the_choice_is_what_the_numbers_say(ran):
    names, printed, _ = ran
    worst = {  # deg, of all joints, by controller: model exact, model wrong
        label: [
            np.degrees(np.abs(c.recording.q - c.recording.q_ref).max())
            for compared in (names["exact"], names["wrong"])
            for c in compared
            if c.label == label
        ]
        for label in names["labels"]
    }
    within = {label: errors for label, errors in worst.items() if max(errors) <= 0.2}

    assert names["choice"] == min(within, key=lambda label: within[label][1]) == "p_pi+id"
    assert set(within) == {"p_pi+id", "inverse_dynamics"}
    assert "take p_pi+id" in printed
    # Feedback linearisation is the better one only as long as its model is exact.
    assert worst["inverse_dynamics"][0] < worst["p_pi+id"][0]
    assert worst["inverse_dynamics"][1] > worst["p_pi+id"][1]


def test_loops_closed_from_outside_follow(ran):
    names, printed, _ = ran
    assert np.degrees(np.abs(names["by_hand"].position_error).max()) < 0.2
    assert names["program"].wait(10) != 0  # it was told to end
    assert np.abs(names["from_afar"].speed_error).max() < 0.25
    own, shipped = (
        np.array(line[line.index("[") + 1 : line.index("]")].split(), dtype=float)
        for line in (line for line in printed if line.startswith(("python-control", "shipped")))
    )
    np.testing.assert_allclose(own, shipped, rtol=0.3)
