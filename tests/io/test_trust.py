"""Trust: what a scenario names as Python is run only once its user has said so."""

import hashlib
import io
import json
import multiprocessing
import os
import shutil
import sys
from pathlib import Path

import pytest

from sdt_drake.io import trust
from sdt_drake.io.errors import InputError
from sdt_drake.run import options
from sdt_drake.run.scenario import load_scenario
from sdt_drake.studies.folder import opened
from sdt_drake.studies.job import make_job
from sdt_drake.studies.study import load_study

OWN = (Path(__file__).parents[1] / "helpers" / "own_controllers.py").read_text(encoding="utf-8")
SCENARIO = """
{motion: short.yaml, plant: {kind: coupled},
 controller: {kind: proportional, file: own.py, omega_r: 66}}
"""
STUDY = """
{scenario: own.yaml, accuracy: 0.01, variables: [
 {fields: [controller.file], distribution: !Choice {values: [own.py, other.py]}}]}
"""


@pytest.fixture
def own(desk, given):
    """One of the controllers' files of a scenario and a study."""
    for name in ("own.py", "other.py"):
        given(name, f"{OWN}with open({str(desk / '../trace')!r}, 'a') as file: file.write('x')")
    given("own.yaml", SCENARIO)
    given("study.yaml", STUDY)
    return desk.parent / "given" / "own.py"


def ran(own):
    """How often these files have been run."""
    trace = own.parents[1] / "trace"
    return len(trace.read_text()) if trace.exists() else 0


def kept():
    """The list of what the user trusts."""
    return Path(os.environ["XDG_CONFIG_HOME"]) / "sdt_drake" / "trusted.json"


def forget():
    """Begin as another process does; what is kept stays."""
    trust._accepted.clear()
    options._loaded.clear()


def digest(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


COMMANDS = [
    "simulate ../given/own.yaml",
    "simulate ../given/run.yaml --set controller.file=../given/own.py",
    "plan --envelope ../given/own.yaml",
    "export ../given/own.yaml --drive drives",
    "study run ../given/study.yaml",
]


@pytest.mark.parametrize("command", COMMANDS)
def test_untrusted_python_without_terminal_is_not_run(refuse, own, command):
    refuse(*command.split(), saying=[f"{own}: is Python", digest(own), "--trust"])
    assert ran(own) == 0


class Terminal(io.StringIO):
    """What is typed at a terminal."""

    def isatty(self):
        return True


def test_trust_is_kept_for_this_content_at_this_place(call, good, own, monkeypatch):
    tune = ("tune", "../given/own.yaml")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    for answer in ("", "n\n", "\n", "nay\n"):
        monkeypatch.setattr(sys, "stdin", Terminal(answer))
        done = call(*tune)
        assert done.code == 2 and "[y/N]" in done.err and ran(own) == 0
        assert f"{own}\nSHA-256 {digest(own)}\n" in done.err
    monkeypatch.setattr(sys, "stdin", Terminal("y\n"))
    assert call(*tune).code == 0 and ran(own) == 1
    assert json.loads(kept().read_text()) == {str(own): digest(own)}
    forget()
    Path("link.py").symlink_to(own)
    good(*tune, "--set", "controller.file=link.py")  # the same file
    shutil.copy(own, "own.py")
    assert "[y/N]" in call(*tune, "--set", "controller.file=own.py").err
    own.write_text(own.read_text() + "# changed\n")
    forget()
    assert call(*tune).code == 2


def test_trust_is_kept_in_an_edited_list(call, own, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(sys, "stdin", Terminal("y\n"))
    kept().parent.mkdir()
    kept().write_text('{"/a": "b"}')
    assert call("tune", "../given/own.yaml").code == 0
    assert json.loads(kept().read_text()) == {"/a": "b", str(own): digest(own)}


def test_concurrent_answers_are_all_kept():
    with multiprocessing.get_context("spawn").Pool(4) as pool:
        pool.starmap(trust.keep, [(f"/{k}", "x") for k in range(40)], chunksize=10)
    assert json.loads(kept().read_text()) == {f"/{k}": "x" for k in range(40)}


def test_trusted_bytes_are_the_ones_run(own):
    with pytest.raises(InputError, match=r"own\.py: is Python .*trust=True"):
        load_scenario("../given/own.yaml")

    def judge(path, found):  # meanwhile, the file becomes another
        own.write_text("raise ValueError('another file')")
        return True

    with trust.asking(judge):
        load_scenario("../given/own.yaml")
    assert ran(own) == 1


def test_studies_ask_once_for_all_their_files(good, refuse, own, desk, undrawn):
    study, base = load_study("../given/study.yaml", trust=True)
    with pytest.raises(InputError, match=r"other\.py: is Python"):
        make_job(study, base)
    job = make_job(study, base, trust=True)
    forget()
    with opened(job, desk / "out", resume=False) as store:
        store.append(job.runner(desk / "rows").run(1), study.inputs(1))
    before = ran(own)
    forget()
    good("study", "show", "out")
    refuse("study", "repeat", "out", "--row", "1", saying=[f"{desk}/out/files", "--trust"])
    assert ran(own) == before > 0


@pytest.mark.parametrize("text", ["[]", "[" * 100_000])
def test_broken_trust_list_is_one_line(refuse, own, text):
    kept().parent.mkdir()
    kept().write_text(text)
    refuse("tune", "../given/own.yaml", saying=[f"{kept()}: cannot be read"])


@pytest.mark.parametrize(
    ("name", "place", "said"), [("XDG_CONFIG_HOME", "h", "--trust"), ("HOME", "h/.config", "$HOME")]
)
def test_relative_place_of_the_trust_list_is_refused(
    desk, own, refuse, monkeypatch, name, place, said
):
    """Or the working directory could bring its own."""
    monkeypatch.setenv("XDG_CONFIG_HOME", "")
    monkeypatch.setenv("HOME", str(desk / "home"))
    monkeypatch.setenv(name, "h")
    there = desk / place / "sdt_drake"
    there.mkdir(parents=True)
    (there / "trusted.json").write_text(json.dumps({str(own): digest(own)}))
    refuse("tune", "../given/own.yaml", saying=[said])
    assert ran(own) == 0
