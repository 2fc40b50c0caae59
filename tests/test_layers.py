"""Imports run in one direction only: the contracts of import-linter in pyproject.toml hold."""

import ast
import pkgutil
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import grimp

PACKAGE = Path(__file__).parents[1] / "sdt_drake"

HIGHER = {
    ("analysis/comparison.py", "show.figures.compared:comparison"),
    ("analysis/comparison.py", "show.figures.compared:overlays"),
    ("analysis/comparison.py", "show.reports.compare:write_comparison_page"),
    ("analysis/frequency_response.py", "show.figures.runs:bode"),
    ("analysis/frequency_response.py", "show.figures.coupled_loop:coupled_loop"),
    ("analysis/loop_step.py", "show.figures.runs:loop_step"),
    ("analysis/stability.py", "show.figures.runs:stability"),
    ("analysis/stops.py", "show.figures.stops:stops_figure"),
    ("machine/accept/results.py", "show.figures.accept:accept_figure"),
    ("pilot/orientation.py", "show.figures.pilot:percept"),
    ("machine/cueing/flight.py", "machine.cueing.flight_proposal:proposal"),
    ("machine/replay.py", "show.figures.replay:replay_figure"),
    ("motion/plan.py", "show.figures.motions:plan"),
    ("motion/trajectory.py", "show.figures.runs:trajectories"),
    ("run/design.py", "analysis.linear:linear"),
    ("run/loop.py", "pilot.in_loop:add_pilot"),
    ("run/loop.py", "pilot.in_loop:start_pilot"),
    ("run/tuning.py", "show.figures.runs:effective_inertia"),
    ("run/recording.py", "show.figures.scope:scope"),
}
"""What methods call in higher layers, by place: the figures of results, `design.linear`, and the
mapping that a refused flight proposes."""


def test_import_contracts_hold():
    """In a process of its own: import-linter switches all existing loggers off."""
    command = Path(sys.executable).with_name("lint-imports")
    root = Path(__file__).parents[1]
    done = subprocess.run([command, "--no-cache"], cwd=root, capture_output=True, text=True)
    assert done.returncode == 0 and "Contracts: 3 kept, 0 broken" in done.stdout, done.stdout


def test_modules_have_no_import_cycles():
    graph = grimp.build_graph("sdt_drake", cache_dir=None)
    imports = {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}
    assert len(list(TopologicalSorter(imports).static_order())) == len(imports)  # or CycleError


def test_only_listed_methods_call_higher_layers():
    calls = {
        (path.relative_to(PACKAGE).as_posix(), ast.literal_eval(node.args[0]))
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "higher"
    }
    assert calls == HIGHER
    assert all(callable(pkgutil.resolve_name(f"sdt_drake.{place}")) for _, place in HIGHER)
