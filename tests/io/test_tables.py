"""Tables: exact in all formats, and every bad file is refused with its line."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sdt_drake.io import numbers
from sdt_drake.io.errors import InputError
from sdt_drake.io.formats import BINARY, TABLES
from sdt_drake.io.tables import read_table, write_table

GOOD = "time,v_1,v_2\n0.0,1,2\n0.5,3,4\n1.0,5,6\n"


NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@pytest.mark.parametrize("suffix", TABLES)
def test_a_table_is_read_back_bit_by_bit(tmp_path, suffix):
    path = tmp_path / "new" / "folder" / f"table{suffix}"

    def check(time, q, tau):
        write_table(path, time, {"q": q, "tau_cmd": tau})
        read_time, columns = read_table(path)
        assert set(columns) == {"q", "tau_cmd"}
        for written, read in ((time, read_time), (q, columns["q"]), (tau, columns["tau_cmd"])):
            assert written.tobytes() == np.ascontiguousarray(read).tobytes()

    @given(st.data(), st.integers(2, 6), st.integers(1, 3))
    def check_any(data, rows, joints):
        values = arrays(float, (rows, joints), elements=NUMBERS)
        check(0.005 * np.arange(rows), data.draw(values), data.draw(values))

    check(np.arange(2.0), np.arange(6.0).reshape(2, 3), np.ones((2, 3)))  # wider than long
    check_any()
    write_table(path.with_suffix(".csv"), np.arange(2), {"q": np.eye(2)})
    assert path.with_suffix(".csv").read_text().startswith("time,q_1,q_2\n")


def test_other_tools_find_the_columns(tmp_path):
    scipy_io, parquet = (pytest.importorskip(x) for x in ("scipy.io", "pyarrow.parquet"))
    q = np.arange(15.0).reshape(5, 3)
    for suffix in BINARY:
        write_table(tmp_path / f"a{suffix}", np.arange(5.0), {"q": q})
    found = scipy_io.loadmat(tmp_path / "a.mat")
    assert found["time"].shape == (5, 1)
    np.testing.assert_array_equal(found["q"], q)
    table = parquet.read_table(tmp_path / "a.parquet")
    assert table.column_names == ["time", "q_1", "q_2", "q_3"]
    np.testing.assert_array_equal(table["q_3"].to_numpy(), q[:, 2])


@pytest.mark.parametrize("suffix", BINARY)
def test_bad_binary_tables_are_refused(tmp_path, suffix, monkeypatch):
    path, v = tmp_path / f"run{suffix}", np.ones((3, 2))
    path.write_text("time,q_1\n")
    with pytest.raises(InputError, match=f"cannot be read as {suffix} "):
        read_table(path)
    path.unlink()
    write_table(path, np.array([0.0, 0.02, 0.015]), {"v": v})
    with pytest.raises(InputError, match=f"run{suffix}, row 3: time goes from 0.02 to 0.015 s"):
        read_table(path)
    write_table(path, np.arange(3.0), {"v": v * np.nan})
    with pytest.raises(InputError, match=f"run{suffix}, row 1: v_1 is nan"):
        read_table(path)
    with pytest.raises(InputError, match=r"xlsx: unknown kind of file, expected \.csv, \.mat"):
        write_table(tmp_path / "run.xlsx", np.arange(3.0), {"v": v})
    if suffix == ".parquet":
        monkeypatch.setitem(sys.modules, "pyarrow", None)
        with pytest.raises(InputError, match=r"pip install 'sdt_drake\[exchange\]'"):
            write_table(path, np.arange(3.0), {"v": v})


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        GOOD.rstrip(),
        GOOD.replace("\n", "\r\n"),
        GOOD.replace(",", " , "),
        GOOD + "\n\n",
        GOOD.replace("time,v_1,v_2", '"time","v_1", "v_2"'),
        GOOD.replace("0.5,3,4", '"0.5","3","4"'),
        "\ufeff" + GOOD,
    ],
    ids=[
        "as_written",
        "no_last_newline",
        "windows",
        "spaces",
        "blank_end",
        "quoted_header",
        "quoted_row",
        "byte_order_mark",
    ],
)
def test_harmless_variants_of_a_table_are_read(tmp_path, text):
    path = tmp_path / "table.csv"
    path.write_bytes(text.encode("utf-8"))
    time, columns = read_table(path)
    np.testing.assert_array_equal(time, [0, 0.5, 1])
    np.testing.assert_array_equal(columns["v"], [[1, 2], [3, 4], [5, 6]])


BAD = [
    (GOOD.replace("v_2", "time"), ": two columns are 'time', expected one"),
    (GOOD.replace("time", "t"), ": the first column is 't', expected 'time'"),
    ("time,v_1,v_2\n0,1,2\n", "fewer than two rows"),
    (GOOD.replace("0.5,3,4", "0.5,3"), r", line 3: 2 value\(s\), expected 3"),
    (GOOD.replace("time,v_1", "time"), r", line 2: 3 value\(s\), expected 2"),
    (GOOD.replace("1.0,5", "1.0,five"), ", line 4: 'five' is not a number"),
    (GOOD.replace("1.0,5", "1.0,5_0"), ", line 4: '5_0' is not a number"),
    (GOOD.replace(",", ";"), ", line 1: semicolons between the columns, expected commas"),
    (GOOD.replace("3,4", "-inf,4"), ", line 3: v_1 is -inf"),
    (GOOD.replace("3,4", "1e999,4"), ", line 3: v_1 is inf"),
    (GOOD.replace("0.5,", "nan,"), ", line 3: time is nan"),
    (GOOD.replace("0.5,3,4\n", "\n0.5,3,nan\n"), ", line 4: v_2 is nan"),
    (GOOD + "2.0,7,8\n", ", line 5: time goes from 1 to 2 s, expected equal steps of 0.5 s"),
    (GOOD + "1.0,7,8\n", ", line 5: time goes from 1 to 1 s"),
    (GOOD.replace("0.5,", "-0.5,"), ", line 3: time goes from 0 to -0.5 s"),
    (GOOD.replace("v_1,v_2", "v_2,v_1"), "column 'v_2', expected 'v_1'"),
    (GOOD.replace("v_2", "w_2"), "column 'w_2', expected 'v_2'"),
    (GOOD.replace("v_2", f"v_{'2' * 5000}"), "column 'v_2+', expected 'v_2'"),
    (GOOD.replace("0.5", "-1e308").replace("1.0", "1e308"), ", line 3: time goes from 0 to -1e"),
]


@pytest.mark.parametrize("text, message", BAD, ids=[case[-1] for case in BAD])
def test_a_bad_table_is_refused_with_file_line_and_value(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=rf"bad\.csv.*{message}") as error:
        read_table(path)
    assert "\n" not in str(error.value)


def test_a_table_that_is_too_large_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(numbers, "MAX_BYTES", len(GOOD) - 1)
    (tmp_path / "large.csv").write_text(GOOD)
    with pytest.raises(InputError, match=rf"large\.csv: {len(GOOD)} bytes, expected at most"):
        read_table(tmp_path / "large.csv")
    monkeypatch.undo()
    monkeypatch.setattr(numbers, "MAX_NUMBERS", 8)
    with pytest.raises(InputError, match=r"large\.csv: more than 8 numbers, expected"):
        read_table(tmp_path / "large.csv")
    monkeypatch.setattr(numbers, "MAX_NUMBERS", 9)
    assert len(read_table(tmp_path / "large.csv")[0]) == 3


def test_a_file_that_cannot_be_read_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"none\.csv: no such file"):
        read_table(tmp_path / "none.csv")
    with pytest.raises(InputError, match="is a folder, expected a file"):
        read_table(tmp_path)
    (tmp_path / "binary.csv").write_bytes(b"time,v_1\n\xff\xfe\n")
    with pytest.raises(InputError, match=r"binary\.csv: cannot be read"):
        read_table(tmp_path / "binary.csv")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-32"])
def test_another_encoding_is_refused_with_the_right_one(tmp_path, encoding):
    path = tmp_path / "other.csv"
    path.write_text(GOOD, encoding=encoding)
    with pytest.raises(InputError, match=r"other\.csv: .*expected a CSV file saved as UTF-8$"):
        read_table(path)
