"""Files from elsewhere, perhaps hostile: any bytes give an object that can be written and read
back, or one InputError."""

from __future__ import annotations

import functools
import io
import json
import resource
import sqlite3
import struct
import subprocess
import sys
import warnings

import numpy as np
import pyarrow as pa
import pytest
from command_line import ARM, SCENARIO
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyarrow import parquet
from robots import URDF
from scipy.io import savemat

from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import Input
from sdt_drake.io.mat import read_mat
from sdt_drake.io.resources import models_dir
from sdt_drake.io.tables import read_table, write_table
from sdt_drake.io.yaml_files import load_yaml, write_yaml, yaml_text
from sdt_drake.machine.drive_files import load_drives
from sdt_drake.machine.fly.flight import load_flight_columns, read_flight
from sdt_drake.machine.recordings import load_columns, read_recording
from sdt_drake.motion import LearnedReference, import_motion, load_profile
from sdt_drake.robot.motors import load_catalogue
from sdt_drake.robot.robot import Robot, edited, load_robot
from sdt_drake.run.scenario import load_scenario
from sdt_drake.show.documents import read_svg
from sdt_drake.studies.store import DATABASE, Store, create
from sdt_drake.studies.study import read_study

TIME = np.arange(5) * 0.005
COLUMNS = {name: np.zeros((5, 4)) for name in ("q_ref", "v_ref", "vd_ref", "q", "v", "tau")}
FLIGHT = "time,f_x,f_y,f_z,omega_x,omega_y,omega_z\n"
FLIGHT += "".join(f"{t / 10},0,0,9.8,0,0,0\n" for t in range(9))


def yaml(name: str) -> bytes:
    return (models_dir() / name).read_bytes()


def table(suffix: str) -> bytes:
    target = io.BytesIO()
    if suffix == ".mat":
        inner = {"q_1": TIME, "deeper": {"v": COLUMNS["v"]}}
        savemat(target, {"time": TIME, **COLUMNS, "log": inner}, do_compression=False)
    elif suffix == ".parquet":
        parquet.write_table(pa.table({"time": TIME, "q_1": TIME}), target)
    else:
        header = ",".join(["time", *(f"{name}_{k}" for name in COLUMNS for k in range(1, 5))])
        rows = np.column_stack([TIME, *COLUMNS.values()])
        np.savetxt(target, rows, delimiter=",", header=header, comments="")
    return target.getvalue()


ABOUT = {"inputs": ["x"], "outcomes": ["y"], "fingerprint": "f", "versions": {}, "files": {}}
ABOUT["contents"] = {}


def database() -> bytes:
    base = sqlite3.connect(":memory:")
    base.execute("CREATE TABLE study (about TEXT)")
    base.execute("INSERT INTO study VALUES (?)", (json.dumps(ABOUT),))
    base.execute('CREATE TABLE rows ("row" INTEGER PRIMARY KEY, "x" REAL, "y" REAL)')
    base.execute("INSERT INTO rows VALUES (0, 1.0, 2.0)")
    base.commit()
    return base.serialize()


def read_store(path):
    with Store(path.parent) as store:
        return store.about, store.done(), list(store.groups())


def read_back(thing, folder):
    """What a reader makes of the object as it is written."""
    if isinstance(thing, Input):
        write_yaml(folder / "again.yaml", thing)
        back = load_yaml(type(thing), folder / "again.yaml")[0]
        same = yaml_text(back) == yaml_text(thing)
    elif isinstance(thing, Robot):
        back = edited(thing, lambda root: None)
        same = back.sdf == thing.sdf and np.array_equal(back.coupling, thing.coupling)
    else:
        time, columns = thing
        write_table(folder / "again.csv", time, columns)
        time_back, back = read_table(folder / "again.csv", even=False)
        both = ((time, time_back), *((columns[name], back[name]) for name in columns))
        same = back.keys() == columns.keys() and all(np.array_equal(*pair) for pair in both)
    assert same
    for path in folder.glob("again.*"):
        path.unlink()


WRITTEN = ("scenario", "profile", "motors", "sdf", "urdf", "csv", "mat", "parquet")
"""Kinds of files that are written, too."""

READERS = {
    "motors": (".yaml", yaml("motors.yaml"), load_catalogue),
    "scenario": (".yaml", SCENARIO.encode(), load_scenario),
    "profile": (".yaml", yaml("motions/leans.yaml"), load_profile),
    "drives": (".yaml", yaml("drives.yaml"), lambda path: load_drives(path, 4)),
    "study": (".yaml", yaml("studies/monte_carlo.yaml"), read_study),
    "columns": (".yaml", b"time: t\nq: [a, b]\ndelimiter: semicolon\n", load_columns),
    "flight columns": (".yaml", yaml("flights/recorder.yaml"), load_flight_columns),
    "sdf": (".sdf", ARM.encode(), load_robot),
    "urdf": (".urdf", URDF.encode(), load_robot),
    "csv": (".csv", table(".csv"), read_table),
    "mat": (".mat", table(".mat"), read_table),
    "parquet": (".parquet", table(".parquet"), read_table),
    "recording": (".csv", table(".csv"), lambda path: read_recording(path, load_robot())),
    "motion": (".csv", table(".csv"), lambda path: import_motion(path, 0.005)),
    "learned": (".csv", table(".csv"), LearnedReference.from_csv),
    "flight": (".csv", FLIGHT.encode(), read_flight),
    "svg": (".svg", b"<svg xmlns='http://www.w3.org/2000/svg'><g/></svg>", read_svg),
    "study.sqlite": (".sqlite", database(), read_store),
}
"""Suffix and content of a file of each kind, and what reads it."""

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


@pytest.mark.parametrize("kind", READERS)
def test_any_bytes_are_an_object_or_an_input_error(kind, tmp_path):
    suffix, content, read = READERS[kind]
    file = tmp_path / (DATABASE if kind == "study.sqlite" else f"file{suffix}")
    found = read(_written(file, content))
    if kind in WRITTEN:
        read_back(found, tmp_path)

    @settings(suppress_health_check=list(HealthCheck))
    @given(changed(content))
    def check(data):
        _written(file, data)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                found = read(file)
                if kind in WRITTEN:
                    read_back(found, tmp_path)
            except InputError as error:
                assert all(line.strip() and "\n" not in line for line in error.lines)

    check()
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


def _written(file, data):
    file.write_bytes(data)
    return file


# --- small files that ask for much -----------------------------------------------------------

_MEMORY, _PATIENCE = 2_500_000_000, 60  # bytes; s, of a busy machine


def element(kind: int, data: bytes) -> bytes:
    return struct.pack("<2I", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def inflating_mat() -> bytes:
    """0.21 GB of zeros in 0.2 MB."""
    target = io.BytesIO()
    savemat(target, {"q": np.zeros((26_000_000, 1))}, do_compression=True)
    return target.getvalue()


def nested_mat(depth: int = 100_000) -> bytes:
    """Structures in each other: scipy's reader ends the process."""
    flags, shape = element(6, struct.pack("<2I", 2, 0)), element(5, struct.pack("<2i", 1, 1))
    names = element(5, struct.pack("<i", 8)) + element(1, b"q".ljust(8, b"\0"))
    head = flags + shape + element(1, b"q") + names
    sizes = (len(head) + k * (8 + len(head)) for k in range(depth, -1, -1))
    whole = b"".join(struct.pack("<2I", 14, size) + head for size in sizes)
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + whole


def inflating_parquet() -> bytes:
    """Two columns of 13 million zeros."""
    target, zeros = io.BytesIO(), np.zeros(13_000_000)
    parquet.write_table(pa.table({"time": zeros, "q_1": zeros}), target)
    return target.getvalue()


def sdf(inside: str) -> bytes:
    return f"<sdf version='1.9'><model name='m'>{inside}</model></sdf>".encode()


BOMBS = {
    "inflating.mat": (inflating_mat, "bytes without compression"),
    "nested.mat": (nested_mat, "20 nested"),
    "inflating.parquet": (inflating_parquet, "26000000 numbers, expected at most 25"),
    "children.sdf": (lambda: sdf("<a/>" * 100_000), "more than 20000 elements"),
    "frames.sdf": (lambda: sdf("<frame name='a'/>" * 1001), "more than 1000 links, joints and"),
    "deep.yaml": (lambda: b"zeta: " + b"[" * 900_000, "50 levels"),
    "deep.sdf": (lambda: b"<a>" * 300_000, "more than 50 nested elements"),
    "digits.csv": (lambda: b"time,q_1\n0," + b"9" * 900_000 + b"\n1,2\n", "q_1 is inf"),
}
"""What makes each file, and what is said of it."""

_READ = """
import sys
from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import read_table
from sdt_drake.robot.robot import load_robot
from sdt_drake.run.scenario import load_scenario

readers = {"sdf": load_robot, "yaml": load_scenario}
for path in sys.argv[1:]:
    try:
        print(readers.get(path.rpartition(".")[2], read_table)(path))
    except InputError as error:
        print(error)
"""


def test_small_files_need_no_more_memory_and_time_than_others(tmp_path):
    paths = [_written(tmp_path / name, make()) for name, (make, _) in BOMBS.items()]
    assert max(path.stat().st_size for path in paths) < 10_000_000
    limit = functools.partial(resource.setrlimit, resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    command = [sys.executable, "-c", _READ, *map(str, paths)]
    options = {"capture_output": True, "text": True, "timeout": _PATIENCE, "preexec_fn": limit}
    done = subprocess.run(command, **options)
    assert (done.returncode, done.stderr) == (0, "")
    for line, (_, told) in zip(done.stdout.splitlines(), BOMBS.values(), strict=True):
        assert told in line


@pytest.mark.parametrize("compressed", [False, True])
def test_matrices_are_those_of_scipy(compressed, tmp_path):
    q = np.arange(12, dtype=np.int16).reshape(6, 2)
    content = {"time": np.arange(6.0), "log": {"q": q, "deeper": {"v": q / 8}}, "text": "a"}
    savemat(tmp_path / "a.mat", content, do_compression=compressed, oned_as="column")
    found = read_mat(tmp_path / "a.mat", 10_000)
    assert set(found) == {"time", "log.q", "log.deeper.v"}
    np.testing.assert_array_equal(found["log.q"], q)
    np.testing.assert_array_equal(found["log.deeper.v"], q / 8)


# --- other files -----------------------------------------------------------------------------

IN_A_WORLD = ARM.replace("<model", "<world name='w'><model").replace("</sdf>", "</world></sdf>")


@pytest.mark.parametrize("text", [ARM, IN_A_WORLD], ids=["model", "world"])
@pytest.mark.parametrize("place", ["<model", "</model>", "</link>"])
def test_a_robot_includes_no_other_file(place, text, tmp_path):
    secret = _written(tmp_path / "secret.sdf", ARM.encode())
    include = f"<include><uri>{secret}</uri></include>"
    path = _written(tmp_path / "a.sdf", text.replace(place, include + place, 1).encode())
    with pytest.raises(InputError, match=r"<include> in <.*> is not supported"):
        load_robot(path)


ABOUTS = [{"contents": {"../secret": ""}}, {"contents": {"/etc/passwd": ""}}, {"files": []}]
ABOUTS += [{"files": {"own.py": "files/../../own.py"}}, {"outcomes": None}]
STATEMENTS = [
    "DROP TABLE rows; CREATE VIEW rows AS WITH RECURSIVE x(row) AS "
    "(SELECT 0 UNION ALL SELECT row + 1 FROM x) SELECT * FROM x",
    "DROP TABLE study; CREATE TABLE study (x, about TEXT AS (hex(zeroblob(1e9))))",
    "CREATE TRIGGER t AFTER INSERT ON rows BEGIN DELETE FROM rows; END",
]


@pytest.mark.parametrize("statements", [*ABOUTS, *STATEMENTS])
def test_a_study_has_its_files_in_its_folder_and_computes_nothing(statements, tmp_path):
    message = "more than two tables of values"
    if isinstance(statements, dict):
        statements = f"UPDATE study SET about = '{json.dumps(ABOUT | statements)}'"
        message = r"study\.sqlite: cannot be used \("
    create(tmp_path, ABOUT, {})
    with sqlite3.connect(tmp_path / DATABASE) as base:
        base.executescript(statements)
    with pytest.raises(InputError, match=message):
        Store(tmp_path)
