"""Exported block diagrams: stable text, named blocks and ports, and the wires of the diagram."""

import itertools
import math
import re

import matplotlib
import numpy as np
import pytest
from helpers.command_line import FIGURE
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from sdt_drake.io.errors import InputError
from sdt_drake.paper.diagrams import DIAGRAMS
from sdt_drake.paper.step_loop import make_step_loop
from sdt_drake.run.design import make_design
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import load_scenario
from sdt_drake.show.block_diagrams import (
    dot_text,
    fingerprint,
    page_of,
    write_diagram,
)
from sdt_drake.show.diagrams import paint
from sdt_drake.show.symbols import PAPER, SYMBOLS
from sdt_drake.systems import encoder
from sdt_drake.systems.gains import tune


@pytest.fixture(scope="module")
def diagrams(_reference_design):
    """The diagrams of the paper's figures."""
    return {name: make(_reference_design) for name, make in DIAGRAMS.items()}


def make_small():
    return make_step_loop(gains=tune([1.0], 60, [1.0]), i_eff=1.0, setpoint_weight=1)


# --- what the figures show -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "signals"), [*((name, None) for name in DIAGRAMS), ("figure6", PAPER)]
)
def test_diagram_words_overlap_neither_wires_nor_boxes(diagrams, name, signals):
    """As matplotlib's font has them; the layout only knows about how wide they are."""
    page = page_of(diagrams[name], signals=signals)
    boxes = [
        Bbox.from_bounds(x - width / 2, y - height / 2, width, height)
        for _, _, shape, x, y, width, height in page.items
        if shape in ("box", "sum")
    ]
    segments = (pair for _, line in page.wires for pair in itertools.pairwise(line))
    ends = [(np.min(pair, axis=0), np.max(pair, axis=0)) for pair in segments]
    wires = [Bbox([low - 0.1, high + 0.1]) for low, high in ends]  # a line has no width by itself
    words = list(words_on(page))
    assert len(words) > len(boxes)
    for word in words:
        own = [box for box in boxes if box.contains(*np.mean(word.get_points(), axis=0))]
        for box in own:
            assert box.x0 + 3 < word.x0 and word.x1 < box.x1 - 3
            assert box.y0 < word.y0 and word.y1 < box.y1
        others = [box for box in boxes if box not in own]
        assert not any(overlap(word, thing) for thing in [*others, *wires])


def test_no_wire_passes_through_a_frame_that_has_neither_of_its_ends(diagrams):
    page = page_of(diagrams["figure6"])
    (frame,) = page.frames
    low = np.subtract((frame.x, frame.y), np.divide((frame.width, frame.height), 2))
    inside = Bbox.from_bounds(*low, frame.width, frame.height)
    ends = {wire: ("/".join(wire.source), "/".join(wire.target)) for wire, _ in page.wires}
    foreign = [
        pair
        for wire, line in page.wires
        if not any(end.startswith(frame.name) for end in ends[wire])
        for pair in itertools.pairwise(line)
    ]
    assert len(foreign) > 5
    for pair in foreign:
        assert not overlap(Bbox([np.min(pair, axis=0), np.max(pair, axis=0) + 1e-6]), inside)


def words_on(page):
    """Places of all words but signs, in points of the page."""
    with matplotlib.rc_context(paint._STYLE):
        figure = paint.figure(page)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        for text in figure.findobj(Text):
            if text.get_text() not in {"", "+", "−"}:
                place = text.get_window_extent(canvas.get_renderer())
                yield Bbox(place.get_points() * 72 / figure.dpi - paint._BORDER)


def test_diagram_text_lines_stand_below_each_other():
    with matplotlib.rc_context(paint._STYLE):
        texts = paint.figure(page_of(make_small(), max_depth=0)).findobj(Text)
        height = {text.get_text(): text.get_window_extent().y0 for text in texts}
    assert height["pi speed"] > height["controller"]


def test_loop_is_drawn_as_committed(diagrams, file_regression):
    """Boxes, wires with their heads, dots of branches, and words, in points of the page."""
    with matplotlib.rc_context(paint._STYLE):
        figure = paint.figure(page_of(diagrams["figure6"]))
    told = []
    for drawn in figure.findobj(lambda artist: isinstance(artist, Patch | Line2D)):
        path = drawn.get_path()
        if isinstance(drawn, Patch):
            path = drawn.get_patch_transform().transform_path(path)
        told.append(f"{type(drawn).__name__} {path.vertices.round(1).tolist()}")
    file_regression.check("\n".join(told) + "\n", encoding="utf-8")


def overlap(one, other):
    apart = np.maximum(one.min, other.min) - np.minimum(one.max, other.max)
    return (apart < 0).all()


def test_diagram_signs_do_not_lie_on_wires():
    """A wire that turns right before the sum."""
    design = make_design(load_scenario("wrong_model"))
    page = page_of(make_loop(design).diagram)
    signs = [item for item in page.items if item.text in {"+", "−"}]
    segments = [pair for _, line in page.wires for pair in itertools.pairwise(line)]
    assert len(signs) == 6
    for sign, ((ax, ay), (bx, by)) in itertools.product(signs, segments):
        dx = max(min(ax, bx) - sign.x, sign.x - max(ax, bx), 0)
        dy = max(min(ay, by) - sign.y, sign.y - max(ay, by), 0)
        assert math.hypot(dx, dy) > 2.3  # points


@pytest.mark.parametrize("resolution", [None, [50.0]])
def test_encoder_block_has_its_period_in_ms(resolution):
    block = encoder(n=1, period=0.005, resolution=resolution, gear_ratio=[2.0])
    assert SYMBOLS["encoder.drives"](block) == "encoder\n5 ms"


def test_ideal_encoder_is_not_drawn_as_a_block():
    """The cascade samples at the reference alone."""
    loop = make_loop(make_design(load_scenario("coupled_pi", {"controller.kind": "p_pi"})))
    texts = [item.text for item in page_of(loop.diagram).items]
    assert texts.count("encoder\n5 ms") == 1


# --- files -----------------------------------------------------------------------------------


def test_svg_has_texts_and_origin(tmp_path):
    diagram = make_small()
    svg = write_diagram(diagram, tmp_path / "loop.svg", format_="svg").read_text(encoding="utf-8")

    assert svg.count(fingerprint(dot_text(diagram))) == 1
    assert {"pi_speed_controller/K_IS", "axis_process"} <= set(re.findall(r'<g id="([^"]*)"', svg))
    assert {"reference", "pi speed controller", "1/s"} <= set(re.findall(r">([^<>]+)</text>", svg))
    # A machine without matplotlib's font takes one without serifs, too.
    assert set(re.findall(r"font-family: ([^;\"]*)", svg)) == {"'DejaVu Sans', Verdana, sans-serif"}


@pytest.fixture
def no_graphviz(tmp_path, monkeypatch):
    """The only folder of programs: empty at first."""
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    return tmp_path / "bin" / "dot"


@pytest.mark.parametrize("format_", ["svg", "png", "pdf"])
def test_pictures_are_drawn_without_any_other_program(tmp_path, no_graphviz, format_):
    path = write_diagram(make_small(), tmp_path / "new" / "loop", format_=format_)
    assert path.read_bytes().startswith(FIGURE[format_])


FAILING = "#!/bin/sh\necho 'bad\nluck' >&2\nexit 1\n"
REFUSED = [
    ({"format_": "eps"}, "", "format: 'eps', expected one of dot, svg, png, pdf"),
    ({"format_": "svg", "drake": True}, "", "Drake's own picture needs Graphviz, .*install it"),
    ({"format_": "png", "drake": True}, FAILING, "Graphviz failed: bad luck"),
]


@pytest.mark.parametrize("options, program, message", REFUSED, ids=[case[-1] for case in REFUSED])
def test_a_picture_that_cannot_be_made_is_one_line_and_keeps_the_old_one(
    tmp_path, no_graphviz, options, program, message
):
    if program:
        no_graphviz.write_text(program)
        no_graphviz.chmod(0o755)
    path = tmp_path / "loop.x"
    path.write_bytes(b"old")
    with pytest.raises(InputError, match=message) as error:
        write_diagram(make_small(), path, **options)
    assert "\n" not in str(error.value) and path.read_bytes() == b"old"
    assert sorted(x.name for x in tmp_path.iterdir()) == ["bin", "loop.x"]
