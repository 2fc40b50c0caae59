"""Rows on disk: nothing that was written is lost, whatever ends the process."""

from __future__ import annotations

import json
import math
import resource
import signal
from contextlib import contextmanager

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.run.scenario import Scenario
from sdt_drake.studies.folder import claim, holds_study
from sdt_drake.studies.job import Job
from sdt_drake.studies.journal import JOURNAL, Journal, Row, read_rows
from sdt_drake.studies.study import Study

ROWS = [
    Row(2, "ok", "", 0.1, (1 / 3, math.nan)),
    Row(0, "failed", "ünexpected \u2028 \\", 0.2, ()),
    Row(3, "ok", "", 1e-7, (-0.0, 5e-324)),
]


@pytest.fixture
def written(tmp_path):
    with Journal(tmp_path, 4, 2) as journal:
        for row in ROWS:
            journal.append(row)
    return tmp_path


def test_rows_come_back_exactly_and_in_order(written):
    expected = [repr(row) for row in sorted(ROWS, key=lambda row: row.number)]
    with Journal(written, 4, 2) as journal:
        assert journal.done.tolist() == [True, False, True, True]
        assert [repr(row) for row in journal.rows()] == expected
    assert [repr(row) for row in read_rows(written, 4, 2)] == expected
    lines = [json.loads(line) for line in (written / JOURNAL).open(encoding="utf-8")]
    assert [line["row"] for line in lines] == [2, 0, 3]


@pytest.mark.parametrize("torn", [1, 30, 59])
def test_torn_last_line_is_done_again(written, torn):
    file = written / JOURNAL
    whole = file.read_bytes()
    file.write_bytes(whole[:-torn])
    assert [row.number for row in read_rows(written, 4, 2)] == [0, 2]

    with Journal(written, 4, 2) as journal:
        assert journal.done.tolist() == [True, False, True, False]
        journal.append(ROWS[2])
        assert [row.number for row in journal.rows()] == [0, 2, 3]
    assert file.read_bytes() == whole


GOOD = '{"row": 1, "status": "ok", "reason": "", "duration": 1.0, "outcomes": [1.0, 2.0]}\n'


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (GOOD, "garbage\n"),
        (GOOD, "\n"),
        (GOOD, "\0\xff\n"),
        (GOOD, "[]\n"),
        (GOOD, "{}\n"),
        (GOOD, "[" * 200_000 + "\n"),
        ('"row": 1', '"row": 4'),
        ('"row": 1', '"row": -1'),
        ('"row": 1', '"row": 1.0'),
        ('"row": 1', '"row": true'),
        ('"ok"', '"good"'),
        ('"ok"', '"failed"'),
        ('""', "5"),
        ('""', '"\\ud800"'),
        ("1.0,", '"1.0",'),
        ("1.0,", "1e999,"),
        ("[1.0, 2.0]", "[1.0]"),
        ("[1.0, 2.0]", f"[1.0, {10**400}]"),
        ("[1.0, 2.0]", '[1.0, "2.0"]'),
        ("[1.0, 2.0]", "[1.0, 1e999]"),
        ("[1.0, 2.0]", "5"),
    ],
)
def test_garbage_is_refused_and_kept(written, old, new):
    file = written / JOURNAL
    first, *others = file.read_bytes().splitlines(keepends=True)
    before = b"".join([first, GOOD.replace(old, new).encode("latin-1"), *others])
    file.write_bytes(before)
    for read in (lambda: Journal(written, 4, 2), lambda: list(read_rows(written, 4, 2))):
        with pytest.raises(InputError, match=r"rows\.jsonl, line 2: is no row of this study"):
            read()
    assert file.read_bytes() == before


def test_one_process_at_a_time(written):
    with Journal(written, 4, 2), pytest.raises(InputError, match="another process runs this study"):
        Journal(written, 4, 2)
    Journal(written, 4, 2).__exit__()


def test_other_rows_may_be_read_meanwhile(tmp_path):
    with Journal(tmp_path, 4, 2) as journal:
        journal.append(ROWS[0])
        reading = read_rows(tmp_path, 4, 2)
        journal.append(ROWS[1])
        assert [row.number for row in reading] == [2]  # what was there when it began
        assert len(list(read_rows(tmp_path, 4, 2))) == 2


def test_no_journal(tmp_path):
    with pytest.raises(InputError, match=r"rows\.jsonl: cannot be read"):
        read_rows(tmp_path, 4, 2)


def test_memory_is_an_offset_a_row(tmp_path):
    with Journal(tmp_path, 1000, 2) as journal:
        arrays = [value for value in vars(journal).values() if isinstance(value, np.ndarray)]
        assert [array.nbytes for array in arrays] == [8000]


@contextmanager
def disk_of(size: int):
    """Files get no larger than that [bytes]."""
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)


def test_full_disk(tmp_path):
    with Journal(tmp_path, 100, 2) as journal:
        with disk_of(1000), pytest.raises(InputError) as raised:
            for number in range(100):
                journal.append(Row(number, "ok", "", 0.5, (1.0, 2.0)))
        kept = [row.number for row in read_rows(tmp_path, 100, 2)]
        assert 0 < len(kept) < 100 and (tmp_path / JOURNAL).read_bytes().endswith(b"}\n")
        assert str(raised.value) == (
            f"{tmp_path / JOURNAL}: cannot be written (File too large); {len(kept)} of 100 runs "
            "are kept, --resume goes on from there"
        )


def test_a_disk_that_is_full_from_the_start_leaves_a_folder_that_can_be_used(tmp_path):
    job = Job(Study(), Scenario(), {}, ("y",), "x", {})
    with disk_of(10), pytest.raises(InputError, match=r"no study can be begun .*File too large"):
        claim(job, tmp_path, resume=False)
    claim(job, tmp_path, resume=False)
    assert holds_study(tmp_path)
