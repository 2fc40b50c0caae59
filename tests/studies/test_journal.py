"""Rows on disk: nothing that was written is lost, whatever ends the process."""

from __future__ import annotations

import json
import math
import subprocess
import sys

import numpy as np
import pytest

from sdt_drake.errors import InputError
from sdt_drake.studies.journal import JOURNAL, Journal, read_rows
from sdt_drake.studies.runs import Row

ROWS = [
    Row(2, "ok", "", 0.1, (1 / 3, math.nan)),
    Row(0, "failed", "ünexpected \u2028 \\", 0.2, ()),
    Row(3, "ok", "", 1e-7, (-0.0, 5e-324)),
]


@pytest.fixture
def written(tmp_path):
    with Journal(tmp_path, 4, 2) as journal:
        journal.append(ROWS[:1])
        journal.append(ROWS[1:])
    return tmp_path


def test_rows_come_back_exactly_and_in_order(written):
    expected = [repr(row) for row in sorted(ROWS, key=lambda row: row.number)]
    with Journal(written, 4, 2) as journal:
        assert journal.done.tolist() == [True, False, True, True]
        assert [repr(row) for row in journal.rows()] == expected
    assert [repr(row) for row in read_rows(written, 4, 2)] == expected


def test_every_line_is_json(written):
    rows = [json.loads(line) for line in (written / JOURNAL).open(encoding="utf-8")]
    assert [row["row"] for row in rows] == [2, 0, 3]


@pytest.mark.parametrize("torn", range(1, 60, 7))
def test_torn_last_line_is_done_again(written, torn):
    file = written / JOURNAL
    whole = file.read_bytes()
    file.write_bytes(whole[:-torn])
    assert [row.number for row in read_rows(written, 4, 2)] == [0, 2]

    with Journal(written, 4, 2) as journal:
        assert journal.done.tolist() == [True, False, True, False]
        journal.append(ROWS[2:])
        assert [row.number for row in journal.rows()] == [0, 2, 3]
    assert file.read_bytes() == whole


@pytest.mark.parametrize(
    "garbage",
    [
        b"garbage\n",
        b"\n",
        b"\0\0\0\0\n",
        b"\xff\xfe\n",
        b"[]\n",
        b"{}\n",
        b"1\n",
        b'{"row": 4, "status": "ok", "reason": "", "duration": 1.0, "outcomes": [1.0, 2.0]}\n',
        b'{"row": -1, "status": "ok", "reason": "", "duration": 1.0, "outcomes": [1.0, 2.0]}\n',
        b'{"row": 1.0, "status": "ok", "reason": "", "duration": 1.0, "outcomes": [1.0, 2.0]}\n',
        b'{"row": true, "status": "ok", "reason": "", "duration": 1.0, "outcomes": [1.0, 2.0]}\n',
        b'{"row": 1, "status": "good", "reason": "", "duration": 1.0, "outcomes": [1.0, 2.0]}\n',
        b'{"row": 1, "status": "ok", "reason": 5, "duration": 1.0, "outcomes": [1.0, 2.0]}\n',
        b'{"row": 1, "status": "ok", "reason": "", "duration": 1.0, "outcomes": [1.0]}\n',
        b'{"row": 1, "status": "ok", "reason": "", "duration": 1.0, "outcomes": [1.0, "x"]}\n',
        b'{"row": 1, "status": "failed", "reason": "", "duration": 1.0, "outcomes": [1.0, 2.0]}\n',
        b'{"row": 1, "status": "ok", "reason": "", "duration": 1.0, "outcomes": 5}\n',
        b'{"row": 1, "status": "ok", "reason": "", "duration": 1.0, "outcomes": [1.0, 1e999]}\n',
        b'{"row": 1, "status": "ok", "reason": "", "duration": 1e999, "outcomes": [1.0, 2.0]}\n',
        b'{"row": 1, "status": "failed", "reason": "\\ud800", "duration": 1.0, "outcomes": []}\n',
        b"[" * 200_000 + b"\n",
    ],
)
def test_garbage_is_refused_and_kept(written, garbage):
    file = written / JOURNAL
    lines = file.read_bytes().splitlines(keepends=True)
    file.write_bytes(b"".join([lines[0], garbage, *lines[1:]]))
    before = file.read_bytes()

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
        journal.append(ROWS[:1])
        reading = read_rows(tmp_path, 4, 2)
        assert next(reading).number == 2
        journal.append(ROWS[1:])
        assert list(reading) == []  # what was there when it began
        assert len(list(read_rows(tmp_path, 4, 2))) == 3


def test_no_journal(tmp_path):
    with pytest.raises(InputError, match=r"rows\.jsonl: cannot be read"):
        list(read_rows(tmp_path, 4, 2))


def test_memory_is_an_offset_a_row(tmp_path):
    with Journal(tmp_path, 1000, 2) as journal:
        journal.append([Row(i, "ok", "x" * 100, 0.5, (1.0, 2.0)) for i in range(1000)])
        arrays = [value for value in vars(journal).values() if isinstance(value, np.ndarray)]
        assert [array.nbytes for array in arrays] == [8000]


DISK_FULL = """
import resource, signal, sys
from pathlib import Path
from sdt_drake.studies.journal import Journal
from sdt_drake.studies.runs import Row

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
with Journal(Path(sys.argv[1]), 100, 2) as journal:
    try:
        for i in range(0, 100, 3):
            journal.append([Row(k, "ok", "", 0.5, (1.0, 2.0)) for k in range(i, i + 3)])
    except ValueError as error:
        print(error)
"""


def test_full_disk(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", DISK_FULL, tmp_path], capture_output=True, text=True, timeout=60
    )
    kept = [row.number for row in read_rows(tmp_path, 100, 2)]

    assert 0 < len(kept) < 100 and len(kept) % 3 == 0  # all of an append, or nothing
    assert (tmp_path / JOURNAL).read_bytes().endswith(b"}\n")
    assert done.stderr == ""
    assert done.stdout == (
        f"{tmp_path / JOURNAL}: cannot be written (File too large); {len(kept)} of 100 runs are "
        "kept, --resume goes on from there\n"
    )
