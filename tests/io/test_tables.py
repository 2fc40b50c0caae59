"""Tables: exact in all formats, and every bad file is refused with its line."""

import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pyarrow import parquet

from sdt_drake.io.errors import MAX_NUMBER, InputError
from sdt_drake.io.formats import TABLES
from sdt_drake.io.numbers import read_numbers
from sdt_drake.io.tables import read_table, write_table

GOOD = "time,v_1,v_2\n0.0,1,2\n0.5,3,4\n1.0,5,6\n"
NUMBERS = st.floats(-MAX_NUMBER, MAX_NUMBER)


@pytest.mark.parametrize("suffix", TABLES)
def test_table_is_read_back_bit_by_bit(tmp_path, suffix):
    path = tmp_path / "new" / "folder" / f"table{suffix}"

    @given(st.data(), st.integers(2, 4), st.integers(1, 5))
    def check(data, rows, joints):  # of which some are wider than long
        values, time = arrays(float, (rows, joints), elements=NUMBERS), 0.005 * np.arange(rows)
        written = {"q": data.draw(values), "tau_cmd": data.draw(values)}
        write_table(path, time, written)
        read_time, read = read_table(path)
        assert read_time.tobytes() == time.tobytes() and read.keys() == written.keys()
        for name, column in written.items():
            assert column.tobytes() == np.ascontiguousarray(read[name]).tobytes()

    check()


def test_other_tools_read_the_columns(tmp_path):
    q = np.arange(15.0).reshape(5, 3)
    for suffix in TABLES:
        write_table(tmp_path / f"a{suffix}", np.arange(5.0), {"q": q})
    found = scipy.io.loadmat(tmp_path / "a.mat")
    assert found["time"].shape == (5, 1)
    np.testing.assert_array_equal(found["q"], q)
    table = parquet.read_table(tmp_path / "a.parquet")
    assert table.column_names == ["time", "q_1", "q_2", "q_3"]
    np.testing.assert_array_equal(table["q_3"].to_numpy(), q[:, 2])
    assert (tmp_path / "a.csv").read_text().startswith("time,q_1,q_2,q_3\n0.0,0.0,1.0,2.0\n1.0,")


def refuse(path, message, content=b""):
    if content:
        path.write_bytes(content)
    with pytest.raises(InputError, match=message) as error:
        read_table(path)
    assert "\n" not in f"{error.value}"


BAD = [
    (GOOD.replace("v_2", "time"), ": two columns are 'time', expected one"),
    (GOOD.replace("time", "t"), ": the first column is 't', expected 'time'"),
    ("time,v_1,v_2\n0,1,2\n", "fewer than two rows"),
    (GOOD.replace("0.5,3,4", "0.5,3"), r", line 3: 2 value\(s\), expected 3"),
    (GOOD.replace("1.0,5", "1.0,5_0"), ", line 4: '5_0' is not a number"),
    (GOOD.replace(",", ";"), ", line 1: semicolons between the columns, expected commas"),
    (GOOD.replace("3,4", "-inf,4"), ", line 3: v_1 is -inf"),
    (GOOD.replace("0.5,", "nan,"), ", line 3: time is nan"),
    (GOOD.replace("0.5,3,4\n", "\n0.5,3,nan\n"), ", line 4: v_2 is nan"),
    (GOOD.replace("3,4", f"3,{'9' * 900_000}"), ", line 3: v_2 is inf"),
    (GOOD + "2.0,7,8\n", ", line 5: time goes from 1 to 2 s, expected equal steps of 0.5 s"),
    (GOOD.replace("0.5,", "-0.5,"), ", line 3: time goes from 0 to -0.5 s"),
    (GOOD.replace("v_2", "w_2"), "column 'w_2', expected 'v_2'"),
    (GOOD.replace("v_2", f"v_{'2' * 5000}"), "column 'v_2+', expected 'v_2'"),
    (
        GOOD.replace("4", "-2e16"),
        r", line 3: v_2 is -2e\+16, expected a finite number of at most 1e",
    ),
]


BAD += [(GOOD.encode(x), "saved as UTF-8$") for x in ("utf-16", "utf-16-le", "utf-32")]


@pytest.mark.parametrize("text, message", BAD, ids=[case[-1] for case in BAD])
def test_bad_table_is_refused_with_file_line_and_value(tmp_path, text, message):
    content = text if isinstance(text, bytes) else text.encode()
    refuse(tmp_path / "bad.csv", rf"bad\.csv.*{message}", content)


def test_too_large_table_is_refused(tmp_path):
    path, size = tmp_path / "large.csv", len(GOOD)
    path.write_text(GOOD)
    assert len(read_numbers(path, max_numbers=9, max_bytes=size).data) == 3
    with pytest.raises(InputError, match=r"large\.csv: more than 8 numbers, expected"):
        read_numbers(path, max_numbers=8)
    with pytest.raises(InputError, match=rf"large\.csv: {size} bytes, expected at most"):
        read_numbers(path, max_bytes=size - 1)
