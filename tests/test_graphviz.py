"""Exported block diagrams: stable text, named blocks and ports, and the wires of the diagram."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import stat
import subprocess
import sys
from collections import Counter

import pytest

from sdt_drake.analysis.block_diagrams import DIAGRAMS, write_block_diagram
from sdt_drake.control import tune
from sdt_drake.errors import InputError
from sdt_drake.graphviz import dot_text, fingerprint, has_graphviz, write_diagram
from sdt_drake.loops import make_loop, make_step_loop

needs_graphviz = pytest.mark.skipif(shutil.which("dot") is None, reason="needs Graphviz")
NAMES = tuple(DIAGRAMS)
PLANT = {"coupled_loop": "multibody_plant"}  # all others: axis_process
ADDRESS = re.compile(r"@|0x[0-9a-f]|drake/|\d{6,}", re.IGNORECASE)

# All texts of one process, as JSON.
SCRIPT = """
import json
from sdt_drake.analysis.block_diagrams import DIAGRAMS
from sdt_drake.design import make_design
from sdt_drake.graphviz import dot_text
from sdt_drake.scenario import load_scenario
junk = [make_design(load_scenario("package://sdt/scenarios/axis_pi.yaml"))]  # moves all numbers
design = make_design(load_scenario("package://sdt/scenarios/coupled_pi.yaml"))
texts = {name: dot_text(make(design)) for name, make in reversed(DIAGRAMS.items())}
print(json.dumps(texts))
"""


@pytest.fixture(scope="module")
def diagrams(_reference_design):
    """The diagrams of the paper's figures, boxed."""
    return {name: make(_reference_design) for name, make in DIAGRAMS.items()}


@pytest.fixture(scope="module")
def texts(diagrams):
    """Their texts as they are exported."""
    return {name: dot_text(diagrams[name]) for name in NAMES}


@pytest.fixture(scope="module")
def closed(diagrams):
    """Their texts with all boxes closed."""
    return {name: dot_text(diagrams[name], max_depth=1) for name in NAMES}


@pytest.fixture
def fake_path(tmp_path, monkeypatch):
    """A PATH with one folder, empty at first."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    return folder


def make_small(kp=1.0):
    return make_step_loop(gains=tune([kp], 60, [1.0]), i_eff=kp, structure="pi", boxed=True)


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


# --- reading .dot back -----------------------------------------------------------------------


def nodes_of(text):
    """Id of each node: its name, and its ports by id (u0, y0, ...)."""
    nodes = {}
    for id_, body in re.findall(r"^(s\d+\w*) \[shape=none, (.*?)^>\];", text, re.M | re.S):
        name = re.search(r"<B>(.*?)</B>", body)  # none: the ports of an opened box
        cells = re.findall(r'<TD [^>]*PORT="(\w+)"[^>]*>(.*?)</TD>', body)
        nodes[id_] = (name[1] if name else "", dict(cells))
    return nodes


def wires_of(text):
    """Wires as (system, port, system, port), from what a reader of the figure sees."""
    nodes = nodes_of(text)

    def end(id_, port):
        name, ports = nodes[id_]
        return name, ports[port]

    pattern = r"^(s\d+\w*):(\w+):\w -> (s\d+\w*):(\w+):\w"
    return Counter(end(a, p) + end(b, q) for a, p, b, q in re.findall(pattern, text, re.M))


def wires_of_diagram(diagram):
    return Counter(
        (
            source.get_name(),
            source.get_output_port(output_index).get_name(),
            target.get_name(),
            target.get_input_port(input_index).get_name(),
        )
        for (target, input_index), (source, output_index) in diagram.connection_map().items()
    )


# --- the same text again ---------------------------------------------------------------------


def test_a_second_build_gives_the_same_text(texts, _reference_design):
    for name, make in reversed(DIAGRAMS.items()):
        assert dot_text(make(_reference_design)) == texts[name], name


def test_another_process_gives_the_same_text(texts):
    environment = os.environ | {"PYTHONHASHSEED": "7"}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True
    )

    assert json.loads(done.stdout) == texts


def test_asking_twice_gives_the_same_text(diagrams, texts):
    assert dot_text(diagrams["figure6"], max_depth=1) == texts["figure6"]


def test_different_diagrams_give_different_texts(texts):
    assert len(set(texts.values())) == len(texts)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("depth", [1, 2, 3])
def test_no_addresses_at_any_depth(diagrams, name, depth):
    assert not ADDRESS.search(dot_text(diagrams[name], max_depth=depth))


@pytest.mark.parametrize("name", NAMES)
def test_ids_count_from_one_without_gaps(texts, name):
    ids = {int(i) for i in re.findall(r"^\s*(?:subgraph cluster|s)(\d+)", texts[name], re.M)}

    assert ids == set(range(1, len(ids) + 1))


# --- names -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_all_blocks_have_names(diagrams, closed, name):
    shown = {shown for shown, _ in nodes_of(closed[name]).values()}

    assert shown == {system.get_name() for system in diagrams[name].GetSystems()}
    assert all(re.fullmatch(r"([a-z][a-z0-9_]*\.)?[A-Za-z][A-Za-z0-9_]*", name) for name in shown)


@pytest.mark.parametrize("name", NAMES)
def test_all_ports_of_boxes_have_names(closed, name):
    # The elements of the controller of Figures 4 and 5 are Drake's own, with Drake's port names.
    boxes = [ports for shown, ports in nodes_of(closed[name]).values() if "." not in shown]
    labels = [label for ports in boxes for label in ports.values()]

    assert labels.count("") < len(labels) / 2
    for label in filter(None, labels):
        assert re.fullmatch(r"[a-z][a-z_]*", label) and label not in ("u", "y"), label


def test_ports_have_the_words_of_the_design(closed):
    ports = {
        (block, label)
        for block, labels in nodes_of(closed["figure6"]).values()
        for label in labels.values()
    }
    assert ports >= {
        ("zero_order_hold", "reference"),
        ("load_torque", "load_torque"),
        ("load_torque", "alleviating_torque"),
        ("pi_speed_controller", "tau_fb"),
        ("ctc_feedforward", "tau_ff"),
        ("ctc_feedforward", "tau_cmd"),
        ("dynamic_saturation", "tau"),
        ("axis_process", "state"),
    }


@pytest.mark.parametrize(
    ("name", "block"),
    [
        ("figure3", "load_torque"),
        ("figure3", "dynamic_saturation"),
        ("figure6", "ctc_feedforward"),
        ("figure6", "disturbance"),
        ("coupled_loop", "multibody_plant"),
        ("coupled_loop", "disturbance"),
    ],
)
def test_figures_show_what_they_are_about(closed, name, block):
    assert block in {shown for shown, _ in nodes_of(closed[name]).values()}


def test_figure3_has_no_compensation_and_figure6_differs_by_it(closed):
    blocks = {
        name: {shown for shown, _ in nodes_of(closed[name]).values()}
        for name in ("figure3", "figure6")
    }

    assert "ctc_feedforward" not in blocks["figure3"]
    assert blocks["figure6"] - blocks["figure3"] == {"ctc_feedforward", "disturbance", "true_load"}


@pytest.mark.parametrize(
    ("name", "proportional_to"), [("figure4", "speed_error"), ("figure5", "minus_motor_speed")]
)
def test_opened_controllers_show_where_the_proportional_gain_sits(texts, name, proportional_to):
    wires = wires_of(texts[name])
    sources = {source for source, _, target, _ in wires if target == "pi_speed_controller.K_PS"}

    assert sources == {f"pi_speed_controller.{proportional_to}"}


# --- wires and layout ------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_wires_are_those_of_the_diagram(diagrams, closed, name):
    assert wires_of(closed[name]) == wires_of_diagram(diagrams[name])


@pytest.mark.parametrize("kind", ["axis_pi", "axis_pi_ctc", "coupled_pi", "coupled_pi_ctc"])
@pytest.mark.parametrize("boxed", [True, False])
def test_wires_of_every_shipped_loop(make_variant, kind, boxed):
    diagram = make_loop(make_variant(kind), boxed=boxed)

    assert wires_of(dot_text(diagram)) == wires_of_diagram(diagram)


@pytest.mark.parametrize("name", NAMES)
def test_plant_is_split_into_inputs_and_outputs(closed, name):
    plant = PLANT.get(name, "axis_process")
    halves = {
        id_: ports for id_, (shown, ports) in nodes_of(closed[name]).items() if shown == plant
    }

    (inputs,) = [id_ for id_ in halves if id_.endswith("in")]
    (outputs,) = [id_ for id_ in halves if id_.endswith("out")]
    assert len(halves) == 2
    assert "tau" in halves[inputs].values() and "state" not in halves[inputs].values()
    assert "state" in halves[outputs].values() and "tau" not in halves[outputs].values()
    # No signal leaves the inputs or enters the outputs: the figure reads from left to right.
    assert not re.search(rf"^{inputs}:", closed[name], re.M)
    assert not re.search(rf"-> {outputs}:", closed[name])
    assert "rankdir=LR" in closed[name]


@pytest.mark.parametrize("name", NAMES)
def test_title_is_the_name_of_the_loop(diagrams, closed, name):
    assert f"<B>{diagrams[name].get_name()}</B>" in closed[name]
    assert "name=" not in closed[name]


def test_depth_opens_boxes(diagrams):
    diagram = diagrams["figure6"]
    closed, opened, all_ = (dot_text(diagram, max_depth=depth) for depth in (1, 2, 50))

    assert "K_PS" not in closed and "K_PS" in opened
    assert len(closed) < len(opened) <= len(all_)


# --- files -----------------------------------------------------------------------------------


def test_write_dot(tmp_path):
    diagram = make_small()
    path = tmp_path / "new" / "loop.dot"

    assert write_diagram(diagram, path) == path
    assert path.read_text(encoding="utf-8") == dot_text(diagram)
    assert names_in(path.parent) == ["loop.dot"]
    write_diagram(diagram, str(path), max_depth=2)
    assert path.read_text(encoding="utf-8") == dot_text(diagram, max_depth=2)


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


@needs_graphviz
def test_write_png(tmp_path):
    path = write_diagram(make_small(), tmp_path / "loop.png", format_="png")

    assert path.read_bytes().startswith(b"\x89PNG")


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


def test_without_graphviz_dot_is_written_all_the_same(design, tmp_path, fake_path):
    paths = write_block_diagram("figure5", design, tmp_path / "out")

    assert [path.name for path in paths] == ["figure5.dot"]
    assert names_in(tmp_path / "out") == ["figure5.dot"]
    assert paths[0].read_text(encoding="utf-8").startswith("digraph")


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


def test_fingerprint_tells_texts_apart():
    assert fingerprint("a") != fingerprint("b")
    assert fingerprint("ü") == "dot sha256 " + hashlib.sha256("ü".encode()).hexdigest()
