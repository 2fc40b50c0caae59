"""Exported block diagrams: stable text, named blocks and ports, and the wires of the diagram."""

from __future__ import annotations

import json
import os
import re
import shutil
import stat
import subprocess
import sys
from collections import Counter

import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.run.loop import make_step_loop
from sdt_drake.show.diagrams import routing, walk
from sdt_drake.show.graphviz import (
    dot_text,
    drake_dot_text,
    fingerprint,
    has_graphviz,
    write_diagram,
)
from sdt_drake.show.paper_diagrams import DIAGRAMS
from sdt_drake.show.symbols import SYMBOLS
from sdt_drake.systems.gains import tune

needs_graphviz = pytest.mark.skipif(shutil.which("dot") is None, reason="needs Graphviz")
NAMES = tuple(DIAGRAMS)

# All texts of one process, as JSON.
SCRIPT = """
import json
from sdt_drake.show.paper_diagrams import DIAGRAMS
from sdt_drake.show.symbols import SYMBOLS
from sdt_drake.run.design import make_design
from sdt_drake.show.graphviz import dot_text, drake_dot_text
from sdt_drake.run.scenario import load_scenario
junk = [make_design(load_scenario("package://sdt/scenarios/axis_pi.yaml"))]  # moves all numbers
design = make_design(load_scenario("package://sdt/scenarios/coupled_pi.yaml"))
texts = {}
for name, make in reversed(DIAGRAMS.items()):
    diagram = make(design)
    texts[name] = [dot_text(diagram), drake_dot_text(diagram)]
print(json.dumps(texts))
"""


@pytest.fixture(scope="module")
def diagrams(_reference_design):
    """The diagrams of the paper's figures."""
    return {name: make(_reference_design) for name, make in DIAGRAMS.items()}


@pytest.fixture(scope="module")
def texts(diagrams):
    """Their texts, ours and Drake's."""
    return {name: [dot_text(diagrams[name]), drake_dot_text(diagrams[name])] for name in NAMES}


@pytest.fixture
def fake_path(tmp_path, monkeypatch):
    """A PATH with one folder, empty at first."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    return folder


def make_small():
    return make_step_loop(gains=tune([1.0], 60, [1.0]), i_eff=1.0, structure="pi")


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def nodes_of(text):
    return set(re.findall(r'^  "([^"]*)" \[', text, re.M)) - set(
        re.findall(r'"((?:dot|note) \d+)"', text)
    )


def edges_of(text):
    return Counter(re.findall(r'^  "([^"]*)" -> "([^"]*)" ', text, re.M))


# --- the same text again ---------------------------------------------------------------------


def test_another_process_gives_the_same_text(texts):
    environment = os.environ | {"PYTHONHASHSEED": "7"}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True
    )

    assert json.loads(done.stdout) == texts


# --- what the figures show -------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_blocks_and_connections_of_the_diagram_are_there(diagrams, name):
    text = dot_text(diagrams[name])
    picture = walk(diagrams[name], symbols=SYMBOLS)

    assert nodes_of(text) == {"/".join(block.path) for block in picture.frame.blocks()}
    assert edges_of(text) == Counter(
        ("/".join(wire.source), "/".join(wire.target)) for wire in picture.wires
    )
    sources = {source for source, _ in edges_of(text)}  # nothing dangles
    assert {node for node in nodes_of(text) if not node.endswith("(out)")} == sources


@needs_graphviz
@pytest.mark.parametrize("name", NAMES)
def test_figures_fit_a_page(diagrams, tmp_path, name):
    path = write_diagram(diagrams[name], tmp_path / "figure.svg", format_="svg")
    svg = path.read_text(encoding="utf-8")
    width, height = map(float, re.search(r'<svg width="(\d+)pt" height="(\d+)pt"', svg).groups())

    assert width / height <= 3.5
    assert 11 * min(1, 17 / 2.54 * 72 / width) >= 8
    assert "baseline-shift" not in svg


def test_a_diagram_with_more_lines_than_can_be_drawn_is_refused(monkeypatch):
    monkeypatch.setattr(routing, "GAP", 40)  # as if no space had been enough
    with pytest.raises(InputError, match=r"^diagram step_loop: too many lines to draw, open fewer"):
        dot_text(make_small())


def test_symbols_of_ones_own_blocks_stand_beside_those_of_the_package():
    text = dot_text(make_small(), symbols={"ConstantVectorSource": "step or load"})
    assert "label=<step or load>" in text and "label=<1 / (I<SUB>eff</SUB> s)>" in text


# --- files -----------------------------------------------------------------------------------


def test_write_dot(tmp_path):
    diagram = make_small()
    path = tmp_path / "new" / "loop.dot"

    assert write_diagram(diagram, path) == path
    assert path.read_text(encoding="utf-8") == dot_text(diagram)
    assert names_in(path.parent) == ["loop.dot"]
    write_diagram(diagram, str(path), max_depth=0, drake=True)
    assert path.read_text(encoding="utf-8") == drake_dot_text(diagram, max_depth=0)


@needs_graphviz
def test_write_svg(tmp_path):
    diagram = make_small()
    path = write_diagram(diagram, tmp_path / "loop.svg", format_="svg")
    text = path.read_text(encoding="utf-8")

    assert "<svg" in text and "pi_speed_controller" in text
    assert text.count(fingerprint(dot_text(diagram))) == 1
    assert names_in(tmp_path) == ["loop.svg"]
    first = path.read_bytes()
    write_diagram(make_small(), path, format_="svg")
    assert path.read_bytes() == first


@pytest.mark.parametrize("format_", ["pdf", "", "SVG", "dot "])
def test_unknown_format_is_refused_with_the_choices(tmp_path, format_):
    with pytest.raises(InputError, match="dot, svg, png"):
        write_diagram(make_small(), tmp_path / "loop.x", format_=format_)

    assert names_in(tmp_path) == []


@pytest.mark.parametrize("format_", ["svg", "png"])
def test_without_graphviz_a_picture_is_refused(tmp_path, fake_path, format_):
    path = tmp_path / f"loop.{format_}"
    path.write_bytes(b"old")
    assert not has_graphviz()

    with pytest.raises(InputError, match="Graphviz") as caught:
        write_diagram(make_small(), path, format_=format_)

    assert "install" in str(caught.value) and "\n" not in str(caught.value)
    assert path.read_bytes() == b"old"
    assert names_in(tmp_path) == ["bin", f"loop.{format_}"]


def test_graphviz_that_fails_is_told_in_one_line(tmp_path, fake_path):
    program = fake_path / "dot"
    program.write_text("#!/bin/sh\necho 'half' > \"$3\"\necho 'bad\nluck' >&2\nexit 1\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    path = tmp_path / "loop.svg"
    path.write_bytes(b"old")
    assert has_graphviz()

    with pytest.raises(InputError, match="bad luck"):
        write_diagram(make_small(), path, format_="svg")

    assert path.read_bytes() == b"old"
    assert names_in(tmp_path) == ["bin", "loop.svg"]
