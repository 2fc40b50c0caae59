"""Rows on disk: nothing that was written is lost, whatever ends the process."""

from __future__ import annotations

import math

import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.studies.store import Store, create
from sdt_drake.studies.table import Row

INPUTS = {"a": 0.1, 'b "c"': "text"}
ABOUT = {"inputs": [*INPUTS], "outcomes": ["x", "y"]} | {
    "fingerprint": "f", "versions": {}, "files": {}, "contents": {},
}  # fmt: skip
ROWS = [
    Row(2, "ok", "", 0.1, (1 / 3, math.nan)),
    Row(0, "failed", "ünexpected \u2028 \\ '", 0.2, ()),
    Row(3, "ok", "", 1e-7, (1e300, 5e-324)),
]


@pytest.fixture
def written(tmp_path):
    create(tmp_path, ABOUT, {"a": False, 'b "c"': True})
    with Store(tmp_path) as store:
        for row in ROWS:
            store.append(row, INPUTS)
    return tmp_path


def test_rows_come_back_exactly_and_in_order(written):
    with Store(written) as store:
        (columns,) = store.groups()
        found = dict(zip(store.kinds, columns, strict=True))
        assert store.done() == {0, 2, 3} and store.about == ABOUT
        assert store.inputs(2) == INPUTS and store.inputs(1) == {}
    assert [*found["row"]] == [0, 2, 3] and [*found["status"]] == ["failed", "ok", "ok"]
    assert [*found["reason"]] == [ROWS[1].reason, "", ""]
    assert [*found["duration"], *found["a"]] == [0.2, 0.1, 1e-7] + [0.1] * 3
    assert [*found["x"], *found["y"]] == [None, 1 / 3, 1e300, None, None, 5e-324]


def test_inputs_that_differ_in_capital_letters_alone_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"cannot begin a study .*duplicate column name: A"):
        create(tmp_path, {"outcomes": []}, {"a": False, "A": False})
    assert not any(tmp_path.iterdir())


def test_full_disk(written):
    with Store(written) as store:
        ((pages,),) = store._database.execute("PRAGMA page_count")
        store._database.execute(f"PRAGMA max_page_count = {pages}")
        with pytest.raises(InputError, match=r"written \(database or disk is full\); \d+ runs are"):
            for number in range(4, 100):
                store.append(Row(number, "ok", 500 * "x", 0.5, (1.0, 2.0)), INPUTS)
        kept = store.done()
    assert kept == {0, 2, *range(3, max(kept) + 1)} and 3 < max(kept) < 99
