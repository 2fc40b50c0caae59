"""Pages of diagrams as text in Graphviz's language, with all positions."""

from itertools import pairwise

from sdt_drake.show.diagrams.page import HEAD, TITLE_X, TITLE_Y, Item, Page, Place, shaft
from sdt_drake.show.diagrams.text import SIZE, in_html, text_size
from sdt_drake.show.diagrams.walk import Wire

_FACE = "Helvetica,Arial,sans-serif"
_SHAPES = {"box": "box", "sum": "circle", "end": "plaintext", "dot": "point"}


def dot_text(page: Page) -> str:
    """Return a page as .dot text, which `dot` draws without a layout of its own."""
    if not page.items:
        return f"digraph {_quoted(page.title)} {{\n}}\n"
    font = f'fontname="{_FACE}", fontsize={SIZE:g}'
    lines = [
        f"digraph {_quoted(page.title)} {{",
        f'  graph [layout=nop2, bb="0,0,{_at(page.width, page.height)}", {font}];',
        f"  node [fixedsize=true, {font}];",
        f"  edge [arrowsize={HEAD / 10:g}];",
        *(_cluster(frame, page.items) for frame in page.frames),
        *map(_node, page.items),
        *(_edge(wire, line) for wire, line in page.wires),
        "}",
    ]
    return "\n".join(lines) + "\n"


def _cluster(frame: Item, items: tuple[Item, ...]) -> str:
    left, right = frame.x - frame.width / 2, frame.x + frame.width / 2
    bottom, top = frame.y - frame.height / 2, frame.y + frame.height / 2
    title = _at(left + TITLE_X + text_size(frame.text)[0] / 2, top - TITLE_Y)
    blocks = (item.name for item in items if item.name.startswith(f"{frame.name}/"))
    return (
        f"  subgraph {_quoted(f'cluster/{frame.name}')} {{ graph [label=<{in_html(frame.text)}>, "
        f'bb="{_at(left, bottom)},{_at(right, top)}", lp="{title}", '
        f'style="dashed", color="gray50", fontcolor="gray35"]; '
        f"{'; '.join(map(_quoted, blocks))}; }}"
    )


def _node(item: Item) -> str:
    label = f"<{in_html(item.text)}>" if item.text else '""'
    return (
        f"  {_quoted(item.name)} [shape={_SHAPES[item.shape]}, label={label}, "
        f'pos="{_at(item.x, item.y)}", width={item.width / 72:.4g}, height={item.height / 72:.4g}];'
    )


def _edge(wire: Wire, line: list[Place]) -> str:
    *_, tip = line
    points = [_at(*line[0])]
    for a, b in pairwise(shaft(line)):
        points += [_at(*a), _at(*b), _at(*b)]
    ends = f"{_quoted('/'.join(wire.source))} -> {_quoted('/'.join(wire.target))}"
    return f'  {ends} [pos="e,{_at(*tip)} {" ".join(points)}"];'


def _quoted(name: str) -> str:
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _at(x: float, y: float) -> str:
    return f"{round(x, 1):g},{round(y, 1):g}"
