"""Files that are written together: all or none, and none that could not be is computed."""

import importlib
from pathlib import Path

import pytest
from helpers import command_line

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import keeping_inputs, replacing_files, write_text
from sdt_drake.machine.drive_files.export import FILES as EXPORTED
from sdt_drake.machine.identify import files as identified_files
from sdt_drake.paper import files
from sdt_drake.show.reports import fly as flown_files
from sdt_drake.show.reports import learning
from sdt_drake.show.reports import replay as replay_report

call, desk, refuse = (getattr(command_line, x) for x in ("call", "desk", "refuse"))


@pytest.fixture
def folder(tmp_path):
    """Holds a file of a set, and one that is none of it."""
    (tmp_path / "there").mkdir()
    for name in ("a.csv", "notes"):
        (tmp_path / "there" / name).write_text("old")
    return tmp_path / "there"


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt])
def test_unfinished_file_set_leaves_nothing(folder, there, error):
    before = command_line.snapshot(folder)
    with pytest.raises(error), replacing_files(folder / ("" if there else "new/below")) as new:
        write_text(new / "a.csv", "new")
        raise error
    assert command_line.snapshot(folder) == before


def test_file_set_is_replaced_and_foreign_files_stay(folder):
    (folder / "below").mkdir()
    (folder / "below" / "mine").write_text("old")
    with replacing_files(folder) as new:
        write_text(new / "a.csv", "new")
        write_text(new / "below/b.csv", "new")
    expected = {"a.csv": b"new", "notes": b"old", "below": None}
    expected |= {"below/b.csv": b"new", "below/mine": b"old"}
    assert command_line.snapshot(folder) == expected


def test_file_set_that_cannot_move_leaves_nothing(folder):
    before = command_line.snapshot(folder)
    refused = pytest.raises(InputError, match=r"a\.csv: is no \.csv file")
    with keeping_inputs(), refused, replacing_files(folder) as new:
        write_text(new / "a.csv", "new")
        write_text(new / "below/b.csv", "new")
    assert command_line.snapshot(folder) == before


def test_marker_file_of_a_set_is_written_last(folder, monkeypatch):
    order, replace = [], Path.replace
    monkeypatch.setattr(Path, "replace", lambda x, y: order.append(y.name) or replace(x, y))
    with replacing_files(folder, last="a.csv") as new:
        for name in ("a.csv", "z.csv", "b.csv"):
            (new / name).write_text("new")
    assert order == ["b.csv", "z.csv", "a.csv"]


COMMANDS = {
    "identify sdt run.csv": (identified_files.FILES, "machine.identify.procedure.identify"),
    "replay run.csv coupled_pi": (replay_report.FILES, "machine.replay.replay"),
    "export --drive drives": (EXPORTED, "run.design.make_design"),
    "learn wrong_model": (learning.ALL_FILES, "run.design.make_design"),
    "reproduce": (files.FILES, "paper.reproduction.reproduce"),
    "fly sdt turn": (flown_files.FILES, "machine.cueing.procedure.fly"),
    "size sizing": (("sizing.txt", "candidates.csv"), "studies.execute.run_study"),
}
"""Commands with the files that they write, and what computes them."""


@pytest.mark.parametrize("line", COMMANDS)
def test_unreplaceable_output_is_refused_before_computing(refuse, desk, monkeypatch, line):
    names, computes = COMMANDS[line]
    module, _, function = computes.rpartition(".")
    monkeypatch.setattr(importlib.import_module(f"sdt_drake.{module}"), function, None)
    for name in names:
        (desk / "out" / name).mkdir(parents=True)
        refuse(*line.split(), "--out", "out", saying=[f"out/{name}: is a folder, expected a file"])
        (desk / "out" / name).rmdir()
