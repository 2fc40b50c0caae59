"""Who speaks of options: the command line, which turns arguments into them, and nobody below it."""

import ast
import inspect
import re
from pathlib import Path

import pytest

import sdt_drake as sdt
from sdt_drake.cli.telling import in_options
from sdt_drake.io.errors import InputError, Problem


def literals(path: Path) -> list[str]:
    """The strings of a module that are no docstrings, each f-string as one."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = [*ast.walk(tree)]
    parts = {part for node in nodes if isinstance(node, ast.JoinedStr) for part in node.values}
    parts |= {node.value for node in nodes if isinstance(node, ast.Expr)}
    texts = [node for node in nodes if isinstance(node, ast.JoinedStr | ast.Constant)]
    return [ast.unparse(node) for node in texts if node not in parts]


def test_messages_below_the_command_line_name_no_option():
    root = Path(sdt.__file__).parent
    found = [
        f"{path}: {text}"
        for path in root.rglob("*.py")
        if path.relative_to(root).parts[0] != "cli"
        for text in literals(path)
        # Documents quote whole commands to copy.
        if re.search("--[a-z]", text) and not ("show" in path.parts and "sdt-drake " in text)
    ]
    assert found == []


def test_python_errors_name_arguments():
    with pytest.raises(InputError, match=r"^cutoff: -1, expected a finite number > 0$"):
        sdt.identify("sdt", "run.csv", cutoff=-1)


def command(scenario, /, *, held_out=0.3, zeta=None, resume=False, robot=None, changes=()):
    """A command."""


OWN = "/runs/own.yaml"
TOLD = [
    (Problem("1", "less", "held_out"), {}, "--held-out: 1, expected less"),
    (Problem("1", "less", "held_out_2"), {}, "held_out_2: 1, expected less"),
    (Problem("0", "more", "zeta[3]", "controller choice"), {}, "--zeta[3]: 0, expected more"),
    (Problem("0", "more", "zeta", OWN), {}, f"{OWN}: zeta: 0, expected more"),
    (Problem("0", "more", "controller.zeta[1]", OWN), {"zeta": [0.0]},
     "--zeta[1]: 0, expected more"),
    (Problem("0", "more", "drive.n1[2]", OWN), {"changes": [("drive.n1", [1])]},
     "--set drive.n1[2]: 0, expected more"),
    (Problem("0", "more", "drive.n0", OWN), {"changes": [("drive.n1", [1])]},
     f"{OWN}: drive.n0: 0, expected more (with --set drive.n1)"),
    (Problem("no.yaml: no such file"), {"changes": [("motion", "no.yaml")]},
     "no.yaml: no such file (with --set motion)"),
    (Problem("a.csv: is a folder"), {"changes": [("motion", "no.yaml")]}, "a.csv: is a folder"),
    (Problem("to continue, resume=True"), {}, "to continue, --resume"),
    (Problem("use --set robot=... or other=True"), {}, "use --set robot=... or other=True"),
    (Problem("3 joints", kind="joints"), {}, "3 joints; give the robot of the motion with --robot"),
]  # fmt: skip


@pytest.mark.parametrize(("problem", "given", "line"), TOLD, ids=[line for *_, line in TOLD])
def test_command_errors_name_the_option_of_the_value(problem, given, line):
    bound = inspect.signature(command).bind("own", **given)
    assert str(in_options(InputError(problem), bound)) == line
