"""What the README shows works."""

from __future__ import annotations

import re
import shlex
from importlib import import_module
from pathlib import Path

import pytest

from sdt_drake.cli import main
from sdt_drake.motion import Motion

design = import_module("sdt_drake.design")  # the name in the package is the function
ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


COMMANDS = [line for block in blocks("sh") for line in block.splitlines()]


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A folder in which the commands are typed one after the other."""
    return tmp_path_factory.mktemp("desk")


@pytest.fixture
def short(monkeypatch):
    """Scenarios end after 3 s; their numbers are not looked at."""

    def first(scenario, robot, whole=design._planned):
        motion = whole(scenario, robot)
        return Motion(motion.period, motion.q[:601], motion.v[:601], motion.vd[:601])

    monkeypatch.setattr(design, "_planned", first)


@pytest.mark.parametrize("line", [line for line in COMMANDS if line.startswith("sdt-drake")])
def test_command_of_the_tour_runs(line, short, desk, monkeypatch, capsys):
    monkeypatch.chdir(desk)
    assert main(shlex.split(line)[1:]) == 0
    assert capsys.readouterr().out
    for name in re.findall(r"--(?:out|record|drive-table) (\S+)", line):
        assert (desk / name).stat().st_size > 1000


def test_python_of_the_tour_runs(short, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out.count("[") >= 3


def test_there_is_one_command_to_reproduce_and_one_to_test():
    set_up = [line for line in COMMANDS if line.startswith("python3 -m venv")]
    assert [line.rsplit("/", 1)[1].split()[0] for line in set_up] == ["sdt-drake", "pytest"]


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
