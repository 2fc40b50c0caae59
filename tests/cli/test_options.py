"""Every option of every command, from its signature: it changes the result, or it is refused."""

import importlib
from dataclasses import fields, is_dataclass
from typing import get_args

import numpy as np
import pytest
from helpers import command_line
from helpers.command_line import AXIS, RUN, SHORT_MOTION, snapshot
from helpers.every_command import EVERY, POSITIONAL

from sdt_drake.cli.app import commands
from sdt_drake.robot.robot import Robot
from sdt_drake.run.design import Design
from sdt_drake.run.scenario import Scenario

call, desk, given = (getattr(command_line, x) for x in ("call", "desk", "given"))

VALUES = {
    "--acceleration": "2 2 2 2", "--alone": "", "--all": "", "--approach": "5", "--at": "0.1",
    "--at-rest": "", "--online": "",
    "--bandwidth": "2", "--cam-points": "20", "--category": "1", "--cutoff": "8",
    "--damping": "0.02", "--departure": "5", "--depth": "0", "--drake": "", "--draws": "3",
    "--duration": "0.2", "--effort": "", "--every": "0.25", "--failed-motor": "2", "--flights": "2",
    "--acceleration-weight": "2", "--vertical-weight": "2",
    "--format": "svg", "--g-weight": "2", "--held-out": "0.2", "--idle-g": "1.2",
    "--inertia": "2", "--input": "extra_load_torque", "--joint": "2", "--knot": "0.5",
    "--margin": "0.5", "--noise": "0.02", "--of": "torque", "--omega-r": "30", "--once": "",
    "--only": "friction", "--paper": "", "--period": "0.01", "--pilot": "", "--pilots": "7",
    "--port": "7100", "--ports": "",
    "--print": "", "--quick": "", "--rate": "2", "--resume": "", "--row": "1", "--show": "",
    "--side": "motor",
    "--size": "0.01", "--setpoint-weight": "1", "--time": "0.25", "--torque-margin": "0.1",
    "--workers": "2", "--zeta": "1 1 1 1",
}  # fmt: skip
"""Values other than the defaults of options that are numbers, choices or flags. Nonsense in place
of names, files and fields is refused, see test_bad_use."""
OWN_VALUES = {("export fmu", "--input"): "reference"}
ELSEWHERE = ("--trust", "--planner", "--anyway")
"""Options tested elsewhere: in test_trust, in test_commands with motions beyond a limit, since
planners leave others as they are, and in test_identify_command with torques in another unit."""

LINES = {
    **POSITIONAL,
    "docs": "simulate", "simulate": f"{RUN} --out x.svg", "view": f"{RUN} --out a.html",
    "export": "moved.csv --drive drives", "tune": f"{SHORT_MOTION} --out t.json",
    "study run": f"monte_carlo --set motion={SHORT_MOTION}",
    "learn": "../given/cascade.yaml", "learn update": "s all.csv --scenario ../given/cascade.yaml",
}  # fmt: skip
OTHER_LINES = {"simulate": RUN, "step": AXIS, "tune": AXIS, "stability": RUN}
"""Other forms of a command: a scenario instead of a motion, no figure, another plant."""
HEAVY = (
    "machine.identify.procedure:identify", "machine.identify.judge:judge", "machine.replay:replay",
    "machine.accept.judge:accept_judge",
    "machine.cueing.procedure:fly", "machine.identify.excitation:excite",
    "analysis.stability:stability", "analysis.loop_step:step",
    "machine.learn.procedure:run_and_learn", "machine.learn.trials:learn",
    "machine.learn.recorded_step:update", "machine.fmu:write_fmu",
    "machine.drive_files.export:export", "studies.execute:run_study", "pilot.pilots:feelings",
)  # fmt: skip
"""Functions that take long: what commands give them stands for the result."""


class ReachedError(Exception):
    """A command has come to such a function."""


@pytest.fixture
def result(crowded, call, undrawn, monkeypatch):
    """Run a command: its exit code, and what it computes, prints and writes."""
    calls = []
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setattr("webbrowser.open", lambda *address: calls.append(address) or True)
    for place in HEAVY:
        module, _, name = place.partition(":")

        def reached(*values, name=name, **options):
            named = sorted((k, plain(options[k])) for k in options)
            calls.append((name, *map(plain, values), *named))
            raise ReachedError

        monkeypatch.setattr(importlib.import_module(f"sdt_drake.{module}"), name, reached)

    def run(line):
        before = snapshot(crowded)
        calls.clear()
        done = call(*line.split())
        files = {k: v for k, v in snapshot(crowded).items() if before.get(k, 0) != v}
        for name in files:
            path = crowded / name
            path.unlink() if path.is_file() else None
        assert done.code in (0, 1, 2) or calls, done
        return done.code, (tuple(calls), done.out, files)

    return run


def plain(value):
    """Plain data as it is, other objects by their type and plain fields."""
    if isinstance(value, list | tuple | np.ndarray):
        return tuple(map(plain, np.ravel(value) if isinstance(value, np.ndarray) else value))
    if is_dataclass(value) and not isinstance(value, Scenario | Robot | Design):
        return type(value).__name__, *(plain(getattr(value, x.name)) for x in fields(value))
    return value if isinstance(value, str | int | float | None) else type(value).__name__


def options_with_values(name):
    """The options of a command that are numbers, choices or flags, from its signature."""
    app = commands(name.split()[0])
    for word in name.split():
        app = app[word]
    for argument in app.assemble_argument_collection():
        kinds = {argument.hint, *get_args(argument.hint)}
        kinds |= {x for kind in kinds for x in get_args(kind)}
        option = argument.names[0]
        if (option.startswith("--") and {bool, int, float} & kinds) or option in VALUES:
            yield option


CASES = [
    (name, line)
    for name in EVERY
    for line in dict.fromkeys((LINES.get(name, ""), OTHER_LINES.get(name, LINES.get(name, ""))))
]


@pytest.mark.parametrize(("name", "line"), CASES)
def test_option_changes_the_result_or_is_refused(result, name, line):
    given = (*line.split(), *ELSEWHERE)
    if not (options := [x for x in options_with_values(name) if x not in given]):
        return
    code, base = result(f"{name} {line}")
    assert code != 2, "the command itself works"
    for option in options:
        value = OWN_VALUES.get((name, option), VALUES[option])
        code, found = result(f"{name} {line} {option} {value}")
        assert code == 2 or found != base, option
