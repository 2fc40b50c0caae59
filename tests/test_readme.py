"""What the README shows works."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

from sdt_drake import cli as commands
from sdt_drake.cli import app as cli
from sdt_drake.cli.app import main
from sdt_drake.motion import Motion

design = import_module("sdt_drake.run.design")  # the name in the package is the function
ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


SET_UP = [line for block in blocks("sh") for line in block.splitlines()]
COMMANDS = re.findall(r"^\| `([^.`][^`]*)` \|", README, re.MULTILINE)
LONG = ("export", "study", "size", "excite", "identify", "replay", "learn", "fly", "reproduce")
"""Of minutes, or of whole motions: that they are taken as written is enough here."""


@pytest.fixture
def short(monkeypatch):
    """Scenarios end after 1 s; their numbers are not looked at."""

    def first(scenario, robot, whole=design.plan_of):
        plan = whole(scenario, robot)
        start = (values[:201] for values in (plan.motion.q, plan.motion.v, plan.motion.vd))
        return replace(plan, motion=Motion(plan.motion.period, *start))

    monkeypatch.setattr(design, "plan_of", first)


def test_commands_run_in_their_order(short, coarse, tmp_path, monkeypatch, capsys):
    """Some take what others write."""
    coarse(0.5)
    monkeypatch.chdir(tmp_path)
    for line in COMMANDS:
        if not line.startswith(LONG):
            write(line, capsys)


def write(line, capsys):
    """Run a command in the current folder; check that it prints and writes its files."""
    assert main(shlex.split(line)) == 0, line
    assert capsys.readouterr().out
    for name in re.findall(r"--(?:out|record) (\S+)", line):
        assert Path(name).stat().st_size > 200, line


def test_every_command_is_told_as_it_is_typed():
    for line in COMMANDS:
        cli.commands(line.split()[0]).parse_args(shlex.split(line))
    told = {line.split()[0] for line in COMMANDS} | {"report"}
    assert told == {name.replace("_", "-") for name in commands.COMMANDS}


def test_python_of_the_tour_runs(short, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out.count("[") >= 3


def test_there_is_one_command_to_reproduce_and_one_to_test():
    assert [line.rsplit("/", 1)[1].split()[0] for line in SET_UP] == ["sdt-drake", "pytest"]


@pytest.mark.parametrize(
    "page", ["README.md", "diagrams/README.md", "models/README.md", "tests/benchmarks/README.md"]
)
def test_links_and_pictures_exist(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for target, heading in re.findall(r"\]\((?!http)([^)#]*)(#[^)]*)?\)", text):
        file = (ROOT / page).parent / target if target else ROOT / page
        assert file.exists(), target
        if heading:
            titles = re.findall(r"^#+ (.*)", file.read_text(encoding="utf-8"), re.MULTILINE)
            assert heading[1:] in {
                re.sub(r"[^\w -]", "", t).lower().replace(" ", "-") for t in titles
            }


def test_readme_is_read_in_one_go():
    assert len(README.splitlines()) <= 150
