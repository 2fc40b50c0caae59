"""Files from elsewhere, perhaps hostile: any bytes give an object that can be written and read
back, or an InputError."""

import functools
import io
import json
import sqlite3
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyarrow as pa
import pytest
from helpers.command_line import ARM, SCENARIO
from helpers.robots import URDF
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pyarrow import parquet
from scipy.io import savemat

from sdt_drake.analysis.stopping import load_stopping
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import Input
from sdt_drake.io.formats import read_binary
from sdt_drake.io.mat import read_mat
from sdt_drake.io.resources import models_dir
from sdt_drake.io.tables import read_table, write_table
from sdt_drake.io.yaml_files import load_yaml, yaml_text
from sdt_drake.machine.cueing.flight import load_flight_columns, read_flight
from sdt_drake.machine.drive_files.drives import load_drives
from sdt_drake.machine.recordings.columns import load_columns
from sdt_drake.motion import load_profile
from sdt_drake.robot.motors import load_catalogue
from sdt_drake.robot.robot import load_robot
from sdt_drake.run.scenario import load_scenario
from sdt_drake.show.documents import read_svg
from sdt_drake.studies.store import DATABASE, About, Store, create
from sdt_drake.studies.study import read_study

TIME, Q = np.arange(5) * 0.005, np.zeros((5, 4))
STUDY = About(), {"x": False}, ["y"]  # identity, inputs, outcomes

FLIGHT = "time,f_x,f_y,f_z,omega_x,omega_y,omega_z\n"
FLIGHT += "".join(f"{t / 10},0,0,9.8,0,0,0\n" for t in range(9))


def yaml(name: str) -> bytes:
    return (models_dir() / name).read_bytes()


def written(name: str, write: Callable[[Path], object]) -> bytes:
    with TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return (Path(folder) / name).read_bytes()


def table(name: str) -> tuple[bytes, Callable[[Path], object]]:
    return written(name, lambda path: write_table(path, TIME, {"q": Q, "tau": Q})), read_table


def read_store(path):
    with Store(path.parent) as store:
        return store.about, store.done(), store.runs()


READERS = {
    "motors.yaml": (yaml("motors.yaml"), load_catalogue),
    "scenario.yaml": (SCENARIO.encode(), load_scenario),
    "profile.yaml": (yaml("motions/leans.yaml"), load_profile),
    "drives.yaml": (yaml("drives.yaml"), lambda path: load_drives(path, 4)),
    "stops.yaml": (yaml("stops.yaml"), lambda path: load_stopping(path, 4)),
    "study.yaml": (yaml("studies/monte_carlo.yaml"), read_study),
    "columns.yaml": (b"time: t\nq: [a, b]\ndelimiter: semicolon\n", load_columns),
    "recorder.yaml": (yaml("flights/recorder.yaml"), load_flight_columns),
    "flight.csv": (FLIGHT.encode(), read_flight),
    "robot.sdf": (ARM.encode(), load_robot),
    "robot.urdf": (URDF.encode(), load_robot),
    "table.csv": table("table.csv"),
    "table.mat": table("table.mat"),
    "table.parquet": table("table.parquet"),
    "picture.svg": (b"<svg xmlns='http://www.w3.org/2000/svg'><g/></svg>", read_svg),
    DATABASE: (written(DATABASE, lambda path: create(path.parent, *STUDY)), read_store),
}
"""A file of each kind, and what reads it."""

TOKENS = [
    b"\0", b"\xff\xfe", b"-1", b"nan", b"1e999", b"9" * 400, b"[", b"{", b"&a ", b"*a",
    b"!!python/", b"<", b"</", b"<!--", b"<![CDATA[", b"&#0;", b"'", b'"', b",", b"\n", b"\r",
    b"\xc3\x28", b"",
]  # fmt: skip


@st.composite
def changed(draw, content: bytes) -> bytes:
    """Bytes of a file with some others in them, or none of them at all."""
    if draw(st.integers(0, 5)) == 0:
        return draw(st.binary(max_size=200))
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(content)))
        gone = draw(st.integers(0, 20))
        new = draw(st.sampled_from(TOKENS) | st.binary(max_size=8))
        content = content[:at] + new + content[at + gone :]
    return content


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", READERS)
def test_random_bytes_give_a_writable_object_or_an_input_error(name, tmp_path):
    (content, read), file, again = READERS[name], tmp_path / name, tmp_path / "again.yaml"

    @settings(suppress_health_check=list(HealthCheck))
    @given(changed(content))
    @example(content)
    def check(data):
        file.write_bytes(data)
        try:
            found = read(file)
        except InputError as error:
            assert data != content
            assert all(line.strip() and "\n" not in line for line in error.lines)
            return
        if isinstance(found, Input):
            text = yaml_text(found)
            again.write_text(text, encoding="utf-8")
            assert yaml_text(load_yaml(type(found), again)[0]) == text
            again.unlink()

    check()
    assert [path.name for path in tmp_path.iterdir()] == [name]


# --- small files that ask for much -----------------------------------------------------------


NESTED = functools.reduce(lambda inner, _: {"q": inner}, range(25), {"q": TIME})
"""Structures in each other, of which many make scipy's reader end the process."""
ZEROS = pa.table(dict.fromkeys(("time", "q_1"), np.zeros(500)))

LARGE = [
    ("a.mat", lambda path: savemat(path, {"q": np.zeros((26, 1000))}, do_compression=True),
     "more than 7200 bytes without compression"),
    ("a.mat", lambda path: savemat(path, NESTED), "20 nested"),
    ("a.parquet", lambda path: parquet.write_table(ZEROS, path),
     "1000 numbers, expected at most 900 in a file of its size"),
]  # fmt: skip


@pytest.mark.parametrize("name, write, message", LARGE)
def test_files_that_expand_in_memory_are_refused(name, write, message):
    with TemporaryDirectory() as folder, pytest.raises(InputError, match=message):
        write(Path(folder) / name)
        read_binary(Path(folder) / name, 900)


MAT = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


def zeros_mat() -> bytes:
    """A matrix of 3.7 GB of zeros in 3.6 MB, packed once and repeated."""
    pack = zlib.compressobj()
    start, block = (
        pack.compress(x) + pack.flush(zlib.Z_FULL_FLUSH) for x in (b"\x0e", bytes(2**20))
    )
    return MAT + struct.pack("<2I", 15, len(start) + 3500 * len(block)) + start + 3500 * block


def deep_mat(depth: int = 100_000) -> bytes:
    """Structures in each other: scipy's reader ends the process."""

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack("<2I", kind, len(data)) + data + b"\0" * (-len(data) % 8)

    flags, shape = element(6, struct.pack("<2I", 2, 0)), element(5, struct.pack("<2i", 1, 1))
    names = element(5, struct.pack("<i", 8)) + element(1, b"q".ljust(8, b"\0"))
    head = flags + shape + element(1, b"q") + names
    sizes = (len(head) + k * (8 + len(head)) for k in range(depth, -1, -1))
    whole = b"".join(struct.pack("<2I", 14, size) + head for size in sizes)
    return MAT + whole


def zeros_parquet() -> bytes:
    """Two columns of 13 million zeros in 0.1 MB."""
    target, zeros = io.BytesIO(), np.zeros(13_000_000)
    parquet.write_table(pa.table({"time": zeros, "q_1": zeros}), target)
    return target.getvalue()


def aliases_yaml() -> bytes:
    """A list of 9^18 numbers, each line nine times the line before."""
    lines = [f"a{k + 1}: &a{k + 1} [{', '.join([f'*a{k}'] * 9)}]" for k in range(18)]
    return "\n".join(["a0: &a0 [1, 1]", *lines]).encode()


SPACES = " ".join(f'xmlns:x{k}=""' for k in range(40_000)).encode()
BOMBS = {
    "zeros.mat": (zeros_mat, "bytes without compression"),
    "deep.mat": (deep_mat, "20 nested"),
    "zeros.parquet": (zeros_parquet, "26000000 numbers, expected at most 25"),
    "children.sdf": (lambda: b"<sdf>" + 2_000_000 * b"<a/>" + b"</sdf>", "more than 20000 element"),
    "spaces.sdf": (lambda: b"<sdf><a " + SPACES + b"/></sdf>", "<a> has 40000 attributes"),
    "deep.sdf": (lambda: 3_000_000 * b"<a>", "more than 50 nested elements"),
    "deep.yaml": (lambda: b"zeta: " + 300_000 * b"[", "50 levels"),
    "aliases.yaml": (aliases_yaml, "at most 200000 values"),
    "names.yaml": (lambda: b"".join(b"x%d: 1\n" % k for k in range(4_000)), "x0: no such field"),
    "digits.csv": (lambda: b"time,q_1\n0," + 9_000_000 * b"9" + b"\n1,2\n", "line 2: q_1 is inf"),
    "lines.csv": (lambda: b"time,q_1\n" + 1_000_000 * b"\n", "fewer than two rows"),
}
"""What makes each small file, and what is said of it."""


def test_small_files_need_no_more_memory_and_time_than_promised(tmp_path):
    paths = [tmp_path / name for name in BOMBS]
    for path, (make, _) in zip(paths, BOMBS.values(), strict=True):
        path.write_bytes(make())
        assert path.stat().st_size < 10_000_000
    command = [sys.executable, "-m", "helpers.bounded_reads", *map(str, paths)]
    tests = Path(__file__).parents[1]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tests)
    assert (done.returncode, done.stderr) == (0, "")
    for line, path, (_, told) in zip(done.stdout.splitlines(), paths, BOMBS.values(), strict=True):
        assert line.startswith(str(path)) and told in line


def test_compressed_matrices_equal_scipys(tmp_path):
    q = np.arange(12, dtype=np.int16).reshape(6, 2)
    content = {"time": np.arange(6.0), "log": {"q": q, "deeper": {"v": q / 8}}, "text": "a"}
    savemat(tmp_path / "a.mat", content, do_compression=True, oned_as="column")
    found = read_mat(tmp_path / "a.mat", 10_000)
    assert set(found) == {"time", "log.q", "log.deeper.v"}
    np.testing.assert_array_equal(found["log.q"], q)
    np.testing.assert_array_equal(found["log.deeper.v"], q / 8)


# --- other files -----------------------------------------------------------------------------

IN_A_WORLD = ARM.replace("<model", "<world name='w'><model").replace("</sdf>", "</world></sdf>")


@pytest.mark.parametrize("text", [ARM, IN_A_WORLD], ids=["model", "world"])
@pytest.mark.parametrize("place", ["<model", "</model>", "</link>"])
def test_robot_that_includes_files_is_refused(place, text, tmp_path):
    secret, path = tmp_path / "secret.sdf", tmp_path / "a.sdf"
    secret.write_text(ARM)
    path.write_text(text.replace(place, f"<include><uri>{secret}</uri></include>{place}", 1))
    with pytest.raises(InputError, match=r"<include> in <.*> is not supported"):
        load_robot(path)


ABOUTS = [{"contents": {"../secret": ""}}, {"contents": {"/etc/passwd": ""}}, {"files": []}]
ABOUTS += [{"files": {"own.py": "files/../../own.py"}}, {"contents": {"study.yaml": 5}}]
ABOUTS += [{"versions": {"drake": 1}}, {"versions": None}, []]
COLUMNS = ["RENAME status TO x2", "DROP duration", "RENAME row TO z", "ADD z TEXT", "ADD z BLOB"]
STATEMENTS = [
    "DROP TABLE rows; CREATE VIEW rows AS SELECT 0 AS row",
    "DROP TABLE study; CREATE TABLE study (x, about TEXT AS (hex(zeroblob(1e9))))",
    "CREATE TRIGGER t AFTER INSERT ON rows BEGIN DELETE FROM rows; END",
]


ROWS = ["-1, 1, 'ok', '', 1, 'a'", "0, 'a', 'ok', '', 1, 1", "0, 1, 'fine', '', 1, 1"]
ROWS += ["0, 1, 'ok', x'00', 1, 1", "0, 1, NULL, '', 1, 1", "0, 1, 'ok', '', 1, 9e999"]


@pytest.mark.parametrize("values", ROWS)
def test_study_row_with_impossible_values_is_refused(values, tmp_path):
    create(tmp_path, *STUDY)
    with sqlite3.connect(tmp_path / DATABASE) as base:
        base.execute(f"INSERT INTO rows VALUES ({values})")
    read = [Store.runs, lambda store: store.inputs(int(values.split(",")[0]))]
    for of in read:
        with Store(tmp_path) as store, pytest.raises(InputError, match="cannot be used"):
            of(store)


@pytest.mark.parametrize("number", [-1, 2])
def test_study_row_out_of_range_is_refused(number, tmp_path):
    create(tmp_path, *STUDY)
    with sqlite3.connect(tmp_path / DATABASE) as base:
        base.execute(f"INSERT INTO rows VALUES ({number}, 1, 'ok', '', 1, 1)")
    refused = pytest.raises(InputError, match=rf"\(row {number}, expected 0 to 1\)")
    with Store(tmp_path) as store, refused:
        store.check_numbers(2)


@pytest.mark.parametrize("statements", [*ABOUTS, *COLUMNS, *STATEMENTS])
def test_study_database_with_impossible_contents_is_refused(statements, tmp_path):
    message = "more than two tables of values"
    if not isinstance(statements, str):
        statements = f"UPDATE study SET about = '{json.dumps(statements)}'"
        message = r"study\.sqlite: cannot be used \("
    elif statements in COLUMNS:
        statements = f"ALTER TABLE rows {statements}"
        message = r"study\.sqlite: cannot be used \((its columns are not|'status' is not in list)"
    create(tmp_path, *STUDY)
    with sqlite3.connect(tmp_path / DATABASE) as base:
        base.executescript(statements)
    with pytest.raises(InputError, match=message):
        Store(tmp_path)
