"""Files at the boundary: what is read, what is written, and that the two stay apart."""

import os
from pathlib import Path

import pytest

from sdt_drake.io import files
from sdt_drake.io.arguments import finite_number, positive, whole_periods
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import checked_input, checked_output, keeping_inputs, read_text, replacing
from sdt_drake.io.resources import find_file
from sdt_drake.io.tables import read_table


def write(path, text="new"):
    with replacing(path) as partial:
        partial.write_text(text)


@pytest.fixture
def path(tmp_path):
    (tmp_path / "file.csv").write_text("old")
    (tmp_path / "link").symlink_to("file.csv")
    return tmp_path / "file.csv"


def refused(message, use, *arguments):
    with pytest.raises(InputError, match=message) as error:
        use(*arguments)
    return error.value


USES = [checked_input, find_file, read_table, lambda path: read_text(path, 10), write]


@pytest.mark.parametrize("use", USES)
def test_unprintable_names_pipes_and_folders_are_refused(tmp_path, use):
    for name in ("a\0b", "a\nb", "a\x1b[31mb", "a\u2028b", "a\udcffb", "a\ud800b"):
        refused("control characters or no UTF-8", use, tmp_path / name)
    os.mkfifo(tmp_path / "pipe")
    refused("is a device or pipe, expected a file", use, tmp_path / "pipe")
    refused("is a folder, expected a file", use, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]


def test_symbolic_links_stay_and_dangling_ones_are_refused(path):
    write(path.with_name("link"))
    assert path.with_name("link").is_symlink() and path.read_text() == "new"
    for target in ("nowhere/at/all", "lost"):
        path.with_name("lost").symlink_to(target)
        refused("lost: is a link that leads nowhere", write, path.with_name("lost"))
        path.with_name("lost").unlink()


@pytest.mark.parametrize("alias", ["file.csv", "../{}/file.csv", "link"])
def test_input_is_not_replaced_by_output(path, alias):
    other = path.parent / alias.format(path.parent.name)
    path.write_text("a,b")
    with keeping_inputs():
        checked_input(Path(__file__))
        checked_input(path)
        write(other, "a,b")  # as a study that goes on does
        with keeping_inputs():  # a block within leaves the protection as it is
            refused("is read by this command", write, other, "a,b and more")
        refused("is read by this command", write, other, "a,b and more")
        refused("is read by this command; choose another file", checked_output, other)
    with keeping_inputs():
        checked_output(other)
        refused("is read by this command", checked_input, path)
    with keeping_inputs():
        write(other, "c,d")
        assert read_text(path, 10) == "c,d"  # what was written is read


KINDS = {
    "a.csv": ("time,v_1\n0,0\n", "a letter"), "a.png": ("\x89PNG", "GIF89a"),
    "a.pdf": ("%PDF-1.4", "x"), "a.html": ("\n<!DOCTYPE html>", "<p>mine</p>"),
    "a.json": (' {"a": 1}', "a: 1"), "a.fmu": ("PK", "x"), "a.svg": ("<svg/>", "{}"),
    "a.sdf": ("<?xml?>", "name: x"), "a.dot": ("digraph {}", "a -> b"),
    "a.txt": ("any text", "\0"), "a.yaml": ("a: 1", "\x89PNG\0"), "a.mat": ("MATLAB 5.0", "a,b"),
    "a.parquet": ("PAR1", "a,b"),
}  # fmt: skip
"""Content that may be replaced, by the name of its file, and content that may not."""


@pytest.mark.parametrize("name", KINDS)
def test_file_of_another_kind_is_not_replaced(tmp_path, name):
    path = tmp_path / name
    for old in ("", *KINDS[name]):
        path.write_text(old, encoding="latin-1")
        with keeping_inputs():
            if old != KINDS[name][1]:
                checked_output(path)
                write(path)
                continue
            for use in (checked_output, write):
                refused("would be replaced; choose another name", use, path)
        assert path.read_text(encoding="latin-1") == old
    write(path)  # Python replaces any file


def test_concurrent_writers_of_one_file_do_not_mix(path):
    with replacing(path) as one, replacing(path) as other:
        one.write_text("one")
        other.write_text("other")
    assert path.read_text() == "one" and len(list(path.parent.iterdir())) == 2


def test_taken_folder_is_refused_and_not_left_behind(tmp_path):
    def taken():
        raise InputError("another process")

    with files.alone_in(tmp_path / "new", pytest.fail):
        refused("another process", files.alone_in(tmp_path / "new", taken).__enter__)
    assert not (tmp_path / "new").exists()  # as it is empty


def test_numbers_are_accepted_at_their_bounds(path):
    assert read_text(path, 3) == "old" and finite_number(0, "x", minimum=0) == 0
    refused("file.csv: 3 bytes, expected at most 2", read_text, path, 2)
    with pytest.raises(InputError, match=r"^x: 0, expected a finite number > 0$"):
        positive(0, "x")
    assert whole_periods(0.1 + 0.2, 0.005, "x") == 60  # but for round-off
    refused(r"x: 0\.3004 s is not a whole", whole_periods, 0.3004, 0.005, "x")
