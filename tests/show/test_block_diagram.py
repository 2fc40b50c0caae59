"""Pictures of diagrams: what is in them, their signs and names, and how they lie on a page."""

import itertools
import random
from collections import Counter

import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    Gain,
    Integrator,
    LogVectorOutput,
    MatrixGain,
    PassThrough,
    ZeroOrderHold,
)

from sdt_drake.paper.diagrams import DIAGRAMS
from sdt_drake.paper.step_loop import make_step_loop
from sdt_drake.show.block_diagrams import dot_text
from sdt_drake.show.diagrams import walk as walked
from sdt_drake.show.diagrams.layout import Layout
from sdt_drake.show.diagrams.routing import routed
from sdt_drake.show.diagrams.text import in_html, in_mathtext
from sdt_drake.show.symbols import SYMBOLS
from sdt_drake.systems.gains import tune


def walk(diagram, symbols=SYMBOLS, **arguments):
    return walked(diagram, symbols=symbols, **arguments)


def make_loop():
    """A reference, a controller with symbols, a process, and a log."""
    gains = tune([1.0], 60, [1.0])
    return make_step_loop(gains=gains, i_eff=1.0, setpoint_weight=0)


def wired(*blocks, outputs=(), logged=(), name="diagram"):
    """A diagram of blocks, each with its name and its signals, inputs first; some are read from
    outside. Signals that no block gives are inputs of the diagram."""
    builder, sources, targets = DiagramBuilder(), {}, []
    for block, system, signals in blocks:
        builder.AddNamedSystem(block, system)
        inputs = [system.get_input_port(i) for i in range(system.num_input_ports())]
        read, given = signals.split()[: len(inputs)], signals.split()[len(inputs) :]
        targets += zip(read, inputs, strict=True)
        sources |= {signal: system.get_output_port(i) for i, signal in enumerate(given)}
    for signal, port in targets:
        if signal in sources:
            builder.Connect(sources[signal], port)
        else:
            builder.ExportInput(port, signal)
    for signal in logged:
        LogVectorOutput(sources[signal], builder).set_name(f"log.{signal}")
    for signal in outputs:
        builder.ExportOutput(sources[signal], signal)
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram


def make_chain(*systems, name="chain"):
    """Systems one behind the other, the first fed and the last read from outside."""
    signals = ["speed", *(f"x{number}" for number in range(1, len(systems))), "torque"]
    blocks = []
    for number, system in enumerate(systems):
        others = (f"other{i}" for i in range(1, system.num_input_ports()))
        own = " ".join([signals[number], *others, signals[number + 1]])
        blocks.append((f"s{number}", system, own))
    return wired(*blocks, outputs=["torque"], name=name)


def blocks_of(picture):
    return {block.path[-1]: block for block in picture.frame.blocks()}


def wires_of(picture):
    return Counter((wire.source[-1], wire.target[-1]) for wire in picture.wires)


def signs_of(picture):
    return {(wire.source[-1], wire.target[-1]): wire.sign for wire in picture.wires if wire.sign}


# --- what is in a picture --------------------------------------------------------------------


def test_each_block_and_connection_is_drawn_once():
    picture = walk(make_loop())

    paths = [block.path for block in picture.frame.blocks()]
    pi = ["motor_speed_ref", "minus_motor_speed", "speed_error"]
    pi += ["integral", "K_IS", "K_PS", "tau_fb"]
    assert Counter(paths) == Counter(
        [(name,) for name in ("step_reference", "axis_process", "no_load")]
        + [("pi_speed_controller", name) for name in pi]
    )
    wires = (
        "step_reference motor_speed_ref, motor_speed_ref speed_error, "
        "minus_motor_speed speed_error, minus_motor_speed K_PS, "
        "speed_error integral, integral K_IS, K_IS tau_fb, K_PS tau_fb, "
        "tau_fb axis_process, no_load axis_process, axis_process minus_motor_speed"
    )
    assert wires_of(picture) == Counter(tuple(wire.split()) for wire in wires.split(", "))


@pytest.mark.parametrize(
    ("system", "shape", "text"),
    [
        (Adder(1, 1), "sum", ""),
        (Adder(4, 1), "box", "Σ"),
        (Integrator(1), "box", "1/s"),
        (Gain(2.0, 1), "box", "s0"),
        (Gain(-2.0, 1), "box", "−s0"),
        (MatrixGain([[-1.0]]), "box", "−s0"),
        (ZeroOrderHold(0.005, 1), "box", "ZOH\n5 ms"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_blocks_of_drake_have_their_symbols(system, shape, text):
    block = blocks_of(walk(make_chain(system)))["s0"]

    assert (block.shape, block.text) == (shape, text)


def test_depth_is_the_number_of_levels_that_are_opened():
    closed, opened = walk(make_loop(), max_depth=0), walk(make_loop(), max_depth=1)

    assert blocks_of(closed)["pi_speed_controller"].text == "pi speed\ncontroller"
    assert "K_PS" not in blocks_of(closed) and "K_PS" in blocks_of(opened)
    assert ("pi_speed_controller", "axis_process") in wires_of(closed)
    assert [frame.title for frame in opened.frame.frames()] == ["step_loop", "pi_speed_controller"]


def test_one_block_has_no_frame_and_one_frame_in_a_frame_is_one():
    inside = make_chain(make_chain(Gain(1.0, 1), Integrator(1), name="inner"))
    one, two = (make_chain(inner, Gain(1.0, 1)) for inner in (make_chain(Integrator(1)), inside))

    assert [frame.path for frame in walk(one).frame.frames()] == [()]
    assert [frame.title for frame in walk(two).frame.frames()] == ["chain", "s0: s0"]


# --- names -----------------------------------------------------------------------------------


def test_signals_have_names_at_the_block_that_gives_them():
    """A block names its signal itself if it can; 1/s and r are not the names of signals."""
    labels = {path[-1]: label for (path, _), label in walk(make_loop()).labels.items() if label}
    assert labels == {
        "motor_speed_ref": "motor_speed_ref",
        "minus_motor_speed": "motor_speed",  # its minus stands at the sums
        "integral": "integral",
        "tau_fb": "tau_fb",
        "axis_process": "state",
    }
    text = dot_text(make_loop())
    assert text.count("label=<τ<SUB>fb</SUB>>") == text.count("label=<state>") == 1


def test_greek_letters_subscripts_quotes_and_blocks_without_a_name():
    assert in_html("tau_cmd") == "τ<SUB>cmd</SUB>" and in_html("load_torque") == "load torque"
    assert in_html("K_IS/s") == "K<SUB>IS</SUB>/s" and in_html("a<b\nc") == "a&lt;b<BR/>c"
    assert in_mathtext("I_eff,max s") == r"I$_{\text{eff,max}}$ s"
    assert in_mathtext("load_torque [$]") == r"load torque [\$]"
    builder = DiagramBuilder()
    builder.ExportOutput(builder.AddSystem(ConstantVectorSource([1.0])).get_output_port(), "one")
    text = dot_text(builder.Build())
    assert '"ConstantVectorSource_0"' in text and "0x" not in text
    quoted = dot_text(make_chain(Integrator(1), name='the "loop"'))
    assert quoted.startswith('digraph "the \\"loop\\"" {\n')
    assert dot_text(make_chain(PassThrough(1))) == 'digraph "chain" {\n}\n'


# --- signs -----------------------------------------------------------------------------------


def test_minus_of_gains_is_drawn_at_the_sums():
    picture = walk(make_loop())

    assert signs_of(picture) == {
        ("motor_speed_ref", "speed_error"): "+",
        ("minus_motor_speed", "speed_error"): "−",
        ("K_IS", "tau_fb"): "+",
        ("K_PS", "tau_fb"): "−",
    }
    assert not [block.text for block in picture.frame.blocks() if block.text.startswith("−")]


@pytest.mark.parametrize(
    ("systems", "texts", "signs"),
    [
        ((Gain(-2.0, 1), Gain(-3.0, 1), Adder(1, 1)), ["s0", "s1", ""], {("s1", "s2"): "+"}),
        ((Gain(-2.0, 1), Integrator(1), Adder(1, 1)), ["−s0", "1/s", ""], {("s1", "s2"): "+"}),
        ((MatrixGain([[1.0, -1.0]]), Adder(1, 1)), ["s0", ""], {("s0", "s1"): "+"}),
    ],
    ids=["two make a plus", "stays before other blocks", "of both signs"],
)
def test_minus_moves_through_gains_to_the_sum_but_not_through_integrators(systems, texts, signs):
    picture = walk(make_chain(*systems))

    assert [blocks_of(picture)[f"s{number}"].text for number in range(len(systems))] == texts
    assert signs_of(picture) == signs


# --- on the page -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def page(_reference_design):
    """The most crowded figure, and its positions and lines."""
    picture = walk(DIAGRAMS["figure6"](_reference_design))
    return picture, routed(picture)


def test_wires_lead_from_block_to_block_without_overlap(page):
    check_lines(*page)


def check_lines(picture, router):
    """Wires lead from their block, or a branch of its signal, to a block, each on its own way."""
    blocks = [router.rects[block.path] for block in picture.frame.blocks()]
    begun: dict[tuple, set] = {}
    used = Counter()

    for wire, line in router.lines.items():
        earlier = begun.setdefault((wire.source, wire.output), set())
        assert line[0] in earlier or on_border(router.rects[wire.source], line[0])
        assert on_border(router.rects[wire.target], line[-1])
        assert not any(inside(rect, point) for rect in blocks for point in line[1:-1])
        for a, b in itertools.pairwise(line):
            assert abs(a[0] - b[0]) + abs(a[1] - b[1]) == 1
            used[min(a, b), max(a, b)] += 1
        earlier.update(line)
    assert set(router.lines) == set(picture.wires) and set(used.values()) == {1}


def inside(rect, point):
    return rect.left <= point[0] <= rect.right and rect.top <= point[1] <= rect.bottom


def on_border(rect, point):
    on_edge = point[0] in (rect.left, rect.right) or point[1] in (rect.top, rect.bottom)
    return inside(rect, point) and on_edge


def test_feedback_blocks_stand_below():
    diagram = wired(
        ("error", Adder(2, 1), "reference measured e"),
        ("gain", Gain(2.0, 1), "e u"),
        ("process", Integrator(1), "u state"),
        ("encoder", ZeroOrderHold(0.001, 1), "state measured"),
        outputs=["state"],
    )
    picture = walk(diagram)
    rects = Layout(picture).rects

    assert rects["encoder",].top > rects["process",].bottom
    assert rects["encoder",].right < rects["gain",].left


def make_framed():
    """A loop through a device, a diagram of its own that is fed from outside, too."""
    load = ("sum", Adder(2, 1), "tau load x0"), ("process", Integrator(1), "x0 state")
    return wired(
        ("error", Adder(2, 1), "reference state e"),
        ("gain", Gain(2.0, 1), "e tau"),
        ("device", wired(*load, outputs=["state"]), "tau load state"),
        outputs=["state"],
    )


def test_frame_with_a_diagram_output_ends_the_main_line():
    rects = Layout(walk(make_framed(), {})).rects

    line = [rects[path] for path in [("error",), ("gain",), ("device", "process")]]
    assert {rect.y for rect in line} == {0}
    assert all(one.right < other.left for one, other in itertools.pairwise(line))


def test_loop_begins_where_its_farthest_signal_returns():
    """The reference reaches both first blocks of the loop, and the second one first."""
    diagram = wired(
        ("reference", Integrator(1), "rate r"),
        ("sum", Adder(2, 1), "r e tau"),
        ("error", Adder(2, 1), "r state e"),
        ("process", Integrator(1), "tau state"),
        outputs=["state"],
    )
    rects = Layout(walk(diagram, {})).rects

    assert rects["error",].right < rects["sum",].left
    assert rects["sum",].right < rects["process",].left


def test_diagram_with_empty_symbol_has_no_frame():
    framed, bare = (walk(make_framed(), symbols) for symbols in ({}, {"device": ""}))

    assert [frame.path for frame in framed.frame.frames()] == [(), ("device",)]
    assert [frame.path for frame in bare.frame.frames()] == [()]
    assert wires_of(bare) == wires_of(framed)
    assert "process" in blocks_of(walk(make_framed(), {"device": ""}, max_depth=1))
    assert blocks_of(walk(make_framed(), {"device": ""}, max_depth=0))["device"].text == "device"


@pytest.mark.parametrize(("n", "terms"), [(5, 5), (8, 3)])
def test_random_diagrams_are_drawn(n, terms):
    choose = random.Random(0)
    sums, integrals = [], [(f"state{i}", Integrator(1), f"rate{i} x{i}") for i in range(n)]
    for j in range(n):
        states = " ".join(f"x{i}" for i in choose.sample(range(n), terms))
        sums.append((f"sum{j}", Adder(terms, 1), f"{states} rate{j}"))
    picture = walk(wired(*sums, *integrals))
    router = routed(picture)

    assert len(router.lines) == n * terms + n
    check_lines(picture, router)
