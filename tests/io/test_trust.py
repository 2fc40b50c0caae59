"""Trust: what a scenario names as Python is run only once its user has said so."""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
import sys
from pathlib import Path

import pytest

from sdt_drake.io import trust
from sdt_drake.io.errors import InputError
from sdt_drake.run import kinds
from sdt_drake.run.scenario import load_scenario
from sdt_drake.studies.folder import load_runner
from sdt_drake.studies.job import make_job
from sdt_drake.studies.study import load_study

OWN = (Path(__file__).parents[1] / "own_controllers.py").read_text(encoding="utf-8")
TRACE = "with open({trace!r}, 'a') as file:\n    file.write('x')\n"
SCENARIO = """
motion: short.yaml
plant: {kind: coupled}
controller: {kind: proportional, file: own.py, omega_r: 66}
"""
STUDY = """
scenario: own.yaml
accuracy: 0.01
variables:
- fields: [controller.file]
  distribution: !Choice {values: [own.py, other.py]}
"""


@pytest.fixture
def ran(desk, given):
    """How often the controllers' files of a scenario and a study have been run."""
    trace = desk.parent / "trace"
    for name in ("own.py", "other.py"):
        given(name, OWN + TRACE.format(trace=str(trace)) + f"# {name}\n")
    given("own.yaml", SCENARIO)
    given("study.yaml", STUDY)
    return lambda: len(trace.read_text()) if trace.exists() else 0


@pytest.fixture
def own(desk):
    return desk.parent / "given" / "own.py"


@pytest.fixture
def kept():
    """The list of what the user trusts."""
    return Path(os.environ["XDG_CONFIG_HOME"]) / "sdt_drake" / "trusted.json"


@pytest.fixture
def another_process(monkeypatch):
    """What a process knows is gone; what is kept stays."""

    def forget():
        monkeypatch.setattr(trust, "_accepted", set())
        monkeypatch.setattr(kinds, "_loaded", {})

    return forget


@pytest.fixture
def terminal(monkeypatch):
    """A terminal at which these answers are typed."""

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    def typed(text):
        monkeypatch.setattr(sys, "stdin", Terminal(text))
        monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)

    return typed


def digest(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


PLAIN = ("simulate", "compare", "budget", "bode", "stability", "tune", "diagram", "pilot", "learn")
COMMANDS = [
    *(f"{name} ../given/own.yaml" for name in PLAIN),
    "simulate ../given/run.yaml --set controller.file=../given/own.py",
    "view ../given/own.yaml --record run.html",
    "export ../given/own.yaml --drive drives",
    "plan --envelope ../given/own.yaml",
    "fly sdt turn --out out --envelope ../given/own.yaml",
    "identify sdt run.csv --scenario ../given/own.yaml",
    "replay run.csv ../given/own.yaml",
    "study ../given/study.yaml",
]
"""Each command that loads a scenario."""


@pytest.mark.parametrize("command", COMMANDS)
def test_without_a_terminal_nothing_is_run(refuse, ran, own, command):
    refuse(*command.split(), saying=[f"{own}: is Python", digest(own), "--trust"])
    assert ran() == 0


def test_an_answer_is_kept_for_this_content_at_this_place(
    call, good, ran, own, kept, terminal, another_process
):
    tune = ("tune", "../given/own.yaml")
    for answer in ("", "n\n", "\n", "nay\n"):
        terminal(answer)
        done = call(*tune)
        assert done.code == 2 and "[y/N]" in done.err and ran() == 0
        assert f"{own}\nSHA-256 {digest(own)}\n" in done.err
    terminal("y\n")
    assert call(*tune).code == 0 and ran() == 1
    assert json.loads(kept.read_text()) == {str(own): digest(own)}
    another_process()
    terminal("")
    good(*tune)
    Path("link.py").symlink_to(own)
    good(*tune, "--set", "controller.file=link.py")  # the same file
    shutil.copy(own, "own.py")
    assert "[y/N]" in call(*tune, "--set", "controller.file=own.py").err
    own.write_text(own.read_text() + "# changed\n")
    another_process()
    assert call(*tune).code == 2


def test_the_bytes_that_are_run_are_those_that_were_judged(ran, own):
    with pytest.raises(InputError, match=r"own\.py: is Python .*trust=True"):
        load_scenario("../given/own.yaml")
    assert ran() == 0

    def judge(path, found):  # meanwhile, the file becomes another
        own.write_text("raise ValueError('another file')")
        return True

    with trust.asking(judge):
        load_scenario("../given/own.yaml")
    assert ran() == 1


def test_studies_ask_for_all_their_files_and_their_processes_do_not(
    good, refuse, call, ran, desk, another_process
):
    study, base = load_study("../given/study.yaml", trust=True)
    with pytest.raises(InputError, match=r"other\.py: is Python"):
        make_job(study, base)
    job = make_job(study, base, trust=True)
    another_process()
    assert job.runner(desk / "rows").run(1).status == "ok"
    another_process()
    good("study", "../given/study.yaml", "--out", "out", "--trust")
    before = ran()
    another_process()
    assert good("study", "show", "out").out and ran() == before
    copy = shutil.copytree("out", desk / "copy")
    refuse("study", "repeat", "copy", "--row", "0", saying=[f"{copy}/files", "--trust"])
    assert ran() == before
    with pytest.raises(InputError, match="is Python"):
        load_runner(copy)
    good("study", "repeat", "copy", "--row", "1", "--trust")
    assert ran() > before


@pytest.mark.parametrize("text", ["[]", "[" * 100_000])
def test_a_broken_list_is_a_line(refuse, good, ran, kept, text):
    kept.parent.mkdir()
    kept.write_text(text)
    refuse("tune", "../given/own.yaml", saying=[f"{kept}: cannot be read"])
    assert ran() == 0
    good("tune", "../given/own.yaml", "--trust")


def test_a_relative_place_of_the_list_is_none(ran, desk, own, refuse, monkeypatch):
    """Or the working directory could bring its own."""
    monkeypatch.setenv("XDG_CONFIG_HOME", "config")
    monkeypatch.setenv("HOME", str(desk / "home"))
    (desk / "config" / "sdt_drake").mkdir(parents=True)
    (desk / "config" / "sdt_drake" / "trusted.json").write_text(json.dumps({str(own): digest(own)}))
    refuse("tune", "../given/own.yaml")
    assert ran() == 0
