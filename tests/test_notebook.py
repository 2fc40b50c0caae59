"""The tutorial notebook: its cells run, print what is stored, and support its choice."""

import ast
import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import sdt_drake as sdt
from sdt_drake.analysis.comparison import Comparison
from sdt_drake.show.view3d.viewer import Animation

pytestmark = pytest.mark.documents

NOTEBOOK = Path(__file__).parents[1] / "diagrams" / "tutorial.ipynb"
CELLS = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
CODE = [cell for cell in CELLS if cell["cell_type"] == "code"]
OUTPUTS = [output for cell in CODE for output in cell["outputs"]]


@pytest.fixture(scope="module")
def ran(on_exact_model, on_wrong_model):
    """The names after all cells, what the cells print, and what they end with."""
    names, printed, shown = {}, [], []
    names["print"] = lambda *texts: printed.append(" ".join(map(str, texts)))
    compare, computed = sdt.compare, [on_exact_model, on_wrong_model]

    def once(design, labels):  # the first two comparisons are those of other tests
        if not computed:
            return compare(design, labels)
        runs = computed.pop(0)
        return Comparison(runs[label] for label in labels)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sdt, "compare", once)
        for cell in CODE:
            tree = ast.parse("".join(cell["source"]))
            last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
            exec(compile(tree, NOTEBOOK.name, "exec"), names)
            if last:
                value = compile(ast.Expression(last.value), NOTEBOOK.name, "eval")
                shown.append(eval(value, names))
    return names, printed, shown


def test_notebook_has_16_cells_with_words_before_each():
    assert [cell["cell_type"] for cell in CELLS] == ["markdown", "code"] * 16
    for k, cell in enumerate(CELLS[::2], start=1):
        assert f"## {k}. " in "".join(cell["source"])


def test_stored_notebook_outputs_equal_outputs_of_today(ran):
    _, printed, shown = ran
    stored = "".join("".join(output.get("text", [])) for output in OUTPUTS)
    number, today = re.compile(r"[-+]?\d+\.?\d*"), "\n".join(printed) + "\n"
    assert number.sub("", stored).split() == number.sub("", today).split()
    values = [[float(x) for x in number.findall(text)] for text in (stored, today)]
    np.testing.assert_allclose(values[0], values[1], rtol=0.02, atol=0.02)

    pictures = [output["data"].get("image/png", "") for output in OUTPUTS if "data" in output]
    figures = [item for item in shown if isinstance(item, Figure)]
    assert len(list(filter(None, pictures))) == len(figures) + 1 == 12  # one of the 3D page
    assert max(map(len, pictures)) < 300_000
    # One stands for all: with no backend, and no magic word.
    assert figures[0]._repr_png_().startswith(b"\x89PNG")
    (scene,) = [item for item in shown if isinstance(item, Animation)]
    page = scene._repr_html_()
    assert page.startswith("<iframe ") and "srcdoc=" in page and page.count("<") == 2


def test_notebook_choice_follows_its_numbers(ran, on_exact_model, on_wrong_model):
    names, printed, _ = ran
    worst = {  # deg, of all joints, by controller: model exact, model wrong
        label: [
            np.degrees(np.abs(runs[label].recording.position_error).max())
            for runs in (on_exact_model, on_wrong_model)
        ]
        for label in names["labels"]
    }
    within = {label: errors for label, errors in worst.items() if max(errors) <= 0.2}
    assert names["choice"] == min(within, key=lambda label: within[label][1]) == "p_pi+id"
    assert set(within) == {"p_pi+id", "inverse_dynamics"} and "take p_pi+id" in printed
    # Feedback linearisation is the better one only as long as its model is exact.
    better = np.array(worst["inverse_dynamics"]) < worst["p_pi+id"]
    assert better.tolist() == [True, False]


def test_program_behind_a_socket_controls_the_loop(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (NOTEBOOK.parents[1] / ".github/docs/pages/howto/udp.md").read_text(encoding="utf-8")
    names = {}
    exec(re.search(r"```python\n(.*?)```", page, re.DOTALL)[1], names)
    assert names["program"].wait(10) != 0  # it was told to end
    assert np.abs(names["from_afar"].speed_error).max() < 0.25


def test_notebook_loops_closed_from_outside_follow(ran):
    names, printed, _ = ran
    assert np.degrees(np.abs(names["by_hand"].position_error).max()) < 0.2
    own, shipped = (
        np.array(line[line.index("[") + 1 : line.index("]")].split(), dtype=float)
        for line in printed
        if line.startswith(("python-control", "shipped"))
    )
    np.testing.assert_allclose(own, shipped, rtol=0.3)
