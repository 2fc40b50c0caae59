"""Files at the boundary: what is read, what is written, and that the two stay apart."""

from __future__ import annotations

import os
import pickle
import re

import pytest

from sdt_drake.io import errors
from sdt_drake.io.errors import InputError, Problem, at, checked_number, retelling, within
from sdt_drake.io.files import checked_input, checked_output, keeping_inputs, read_text, replacing
from sdt_drake.io.resources import find_file
from sdt_drake.io.tables import read_table

NAMES = ["a\0b", "a\nb", "a\x1b[31mb", "a\udcffb", "a\ud800b"]
READERS = [checked_input, find_file, read_table, lambda path: read_text(path, 10)]


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "file.csv"
    path.write_text("old")
    return path


def write(path, text="new"):
    with replacing(path) as partial:
        partial.write_text(text)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("use", [*READERS, write])
def test_names_that_nothing_can_show(tmp_path, use, name):
    with pytest.raises(InputError, match="control characters or no UTF-8"):
        use(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("use", [*READERS, write])
def test_pipes_and_folders_are_no_files(tmp_path, use):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="is a device or pipe, expected a file"):
        use(tmp_path / "pipe")
    with pytest.raises(InputError, match="is a folder, expected a file"):
        use(tmp_path)


@pytest.mark.parametrize("target", ["nowhere/at/all", "link"])
def test_a_link_that_leads_nowhere_is_not_followed(tmp_path, target):
    (tmp_path / "link").symlink_to(target)
    with pytest.raises(InputError, match="link: is a link that leads nowhere, expected a file"):
        write(tmp_path / "link")
    assert [path.name for path in tmp_path.iterdir()] == ["link"]


def test_a_link_stays_one(path):
    link = path.with_name("link.csv")
    link.symlink_to(path.name)
    write(link)
    assert link.is_symlink() and path.read_text() == "new"


@pytest.mark.parametrize("alias", ["file.csv", "folder/../file.csv", "link"])
@pytest.mark.parametrize("order", ["read first", "write first"])
def test_what_is_read_is_not_replaced(path, alias, order):
    (path.parent / "folder").mkdir()
    (path.parent / "link").symlink_to(path.name)
    steps = [lambda: checked_input(path), lambda: checked_output(path.parent / alias)]
    first, second = steps if order == "read first" else reversed(steps)
    with keeping_inputs():
        first()
        with pytest.raises(InputError, match="is read by this command; choose another file"):
            second()
    write(path.parent / alias)  # of another command, or of Python


def test_what_is_read_is_replaced_by_the_same_only(path):
    """A study that goes on by the file in its own folder writes that once more."""
    with keeping_inputs():
        checked_input(path)
        write(path, "old")
        checked_input(path)
        with pytest.raises(InputError, match="is read by this command"):
            write(path, "old and more")
    assert path.read_text() == "old"


def test_what_was_written_is_read(path):
    with keeping_inputs():
        for _ in range(3):  # files of old numbers come back with new names
            for name in ("a", "b", "c"):
                write(path.with_name(name))
        assert [read_text(path.with_name(name), 10) for name in ("a", "b", "c")] == ["new"] * 3


@pytest.mark.parametrize(
    ("old", "kept"), [("", False), ("new", False), ("other", True), ("\0", True)]
)
def test_a_file_of_another_kind_is_not_replaced(path, old, kept):
    path.write_text(old)
    with keeping_inputs():
        if kept:
            with pytest.raises(InputError, match="holds something else than this command"):
                write(path)
        else:
            write(path)
    assert path.read_text() == (old if kept else "new")
    assert list(path.parent.iterdir()) == [path]


def test_two_that_write_the_same_file_do_not_meet(path):
    with replacing(path) as one, replacing(path) as other:
        one.write_text("one")
        other.write_text("other")
    assert path.read_text() == "one" and list(path.parent.iterdir()) == [path]


def test_a_text_that_is_too_long(path):
    assert read_text(path, 3) == "old"
    with pytest.raises(InputError, match=re.escape(f"{path}: 3 bytes, expected at most 2")):
        read_text(path, 2)


def test_a_duration_is_whole_periods_but_for_round_off():
    assert errors.whole_periods(0.1 + 0.2, 0.005, "x") == 60
    with pytest.raises(errors.InputError, match=r"x: 0\.3004 s is not a whole multiple"):
        errors.whole_periods(0.3004, 0.005, "x")


def test_a_number_that_is_its_bound():
    assert checked_number(0, "x", minimum=0) == 0
    with pytest.raises(InputError, match=r"^x: 0, expected a finite number > 0$"):
        checked_number(0, "x", minimum=0, exclusive=True)


# --- problems as data ------------------------------------------------------------------------


def refused(make):
    with pytest.raises(InputError) as error:
        make()
    return error.value


def test_places_and_names_are_put_around_problems():
    def fail():
        with within("a.yaml"), within("a.yaml"), at("plant"), at("friction"):
            raise InputError("too large", place="[2]")

    assert refused(fail).problems == (
        Problem("too large", place="plant.friction[2]", where="a.yaml"),
    )
    assert f"{refused(fail)}" == "a.yaml: plant.friction[2]: too large"


def test_problems_may_be_changed_and_sent_to_another_process():
    class OwnError(InputError):
        pass

    def fail():
        with retelling(lambda problem: problem._replace(place="--period")):
            raise OwnError("-1, expected more", place="period")

    error = refused(fail)
    assert type(error) is OwnError and f"{error}" == "--period: -1, expected more"
    plain = InputError(*error.problems)
    assert pickle.loads(pickle.dumps(plain)).problems == plain.problems == error.problems
