"""Recordings in files of others, messages about bad ones, and one of a real robot."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from helpers.strategies import GENERATORS
from hypothesis import given
from hypothesis import strategies as st
from oracles.dh import DATA, UR10, needs_data
from scipy.io import savemat

from sdt_drake.io.errors import InputError
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.recordings.columns import Columns, load_columns
from sdt_drake.machine.recordings.reading import read_recording
from sdt_drake.robot.robot import load_robot

N = 5
HEADER = "time,q_1,q_2,q_3,q_4,tau_1,tau_2,tau_3,tau_4"
MARKS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": "  ", "pipe": "|"}


@pytest.fixture
def table():
    """Time, q and tau of four joints, side by side."""
    return np.column_stack([0.01 * np.arange(N), np.random.default_rng(3).normal(size=(N, 8))])


def write(folder, table, header=HEADER, delimiter=",", encoding="utf-8", decimal="."):
    rows = [delimiter.join(repr(x).replace(".", decimal) for x in row) for row in table.tolist()]
    path = Path(folder) / "r.csv"
    path.write_text("\n".join([header, *rows] if header else rows) + "\n", encoding=encoding)
    return path


@st.composite
def mappings(draw) -> Columns:
    """Mappings of files with four joints, whose columns go by numbers."""
    rng = draw(GENERATORS)
    delimiter = draw(st.sampled_from(list(MARKS)))
    decimal = draw(st.sampled_from(["point", "comma"])) if delimiter != "comma" else "point"
    return Columns(
        delimiter=delimiter, decimal=decimal, header=draw(st.booleans()), time="1",
        encoding=draw(st.sampled_from(["utf-8", "latin-1", "utf-16"])),
        time_factor=draw(st.sampled_from([1.0, 1e-3, 60.0])), v=[],
        q=list("2345"), q_ref=list("2345"), tau=list("6789"), tau_ff=list("6789"),
        angle=draw(st.sampled_from(["deg", "rad", "turn"])),
        side=draw(st.sampled_from(["motor", "joint"])),
        position_side=draw(st.sampled_from(["motor", "joint"])),
        position_offset=rng.normal(size=4).tolist(), torque_factor=rng.uniform(1, 9, 4).tolist(),
        direction=rng.choice([-1.0, 1.0], 4).tolist(),
    )  # fmt: skip


@given(mappings())
def test_recording_is_the_same_in_any_format_unit_and_side(tmp_path_factory, robot, m):
    """The file has what a device in these units would write; the reader undoes all of it."""
    rng, time, gear = np.random.default_rng(1), 0.01 * np.arange(N), robot.gear_ratio
    q, tau = rng.normal(size=(2, N, 4))
    angle, torque = (q - m.position_offset) / m.direction, tau / m.torque_factor / m.direction
    angle = angle / {"rad": 1.0, "deg": np.pi / 180, "turn": 2 * np.pi}[m.angle]
    angle = angle * gear if m.position_side == "motor" else angle
    torque = torque / gear if m.side == "motor" else torque
    path = write(
        tmp_path_factory.mktemp("r"), np.column_stack([time / m.time_factor, angle, torque]),
        "a,b,c,d,e,f,g,h,i".replace(",", MARKS[m.delimiter]) if m.header else "",
        MARKS[m.delimiter], m.encoding, "." if m.decimal == "point" else ",",
    )  # fmt: skip
    recorded = read_recording(path, robot, m)
    np.testing.assert_allclose(recorded.time, time, atol=1e-12)
    for name, values in {"q": q, "q_ref": q, "tau": tau, "tau_ff": tau}.items():
        np.testing.assert_allclose(recorded.signals[name], values, rtol=1e-9, atol=1e-9)
    assert set(recorded.signals) == {"q", "q_ref", "tau", "tau_ff"}


def test_torque_delay_is_taken_off(tmp_path, table, robot):
    path = write(tmp_path, table)
    late = read_recording(path, robot, Columns(torque_delay=0.01)).signals["tau"]
    np.testing.assert_allclose(late[:-1], table[1:, 5:])  # a sample of 10 ms
    np.testing.assert_array_equal(late[-1], table[-1, 5:])


def renamed(name, other):
    return {"header": HEADER.replace(name, other)}


def mapped(**fields):
    return {"columns": Columns(**fields)}


BAD = [
    (renamed("tau_1", "i_1"), r"no column 'tau_1' \(tau\), there are time, q_1"),
    (renamed("tau_4", "q_5"), r"5 or more column\(s\) q_k \(q\), but the robot"),
    (renamed("tau_1", "v_2"), r"no column 'v_1' \(v\)"),
    (renamed("tau_1", "q_1"), r"2 columns 'q_1', expected one; .* number"),
    ({"row": (2, 0, 0.01)}, r"line 4: time goes from 0.01 to 0.01, expected a growing time"),
    ({"delimiter": ";"}, r"line 1: semicolons between .*; or delimiter: semicolon in a mapping"),
    ({"delimiter": "|"}, r"line 1: pipes between .*; or delimiter: pipe in a mapping"),
    (mapped(q=["2", "3", "2", "5"]), r"q: 2 and 2 are the same column"),
    (mapped(q_ref=["wish_{k}"]), r"no column 'wish_1' \(q_ref\)"),
    ({"scale": 1e3}, r"time: 5 samples in 40 s, 0.1 Hz, .*milliseconds .* time_factor: 0.001 in"),
    (mapped(time="", rate=0.005), r"rate: 5 samples in 800 s, .*; rate: 200 in"),
]


@pytest.mark.parametrize("change, message", BAD, ids=[case[-1] for case in BAD])
def test_unreadable_recording_is_one_line(tmp_path, table, robot, change, message):
    table[:, 0] *= change.get("scale", 1)
    if "row" in change:
        row, column, value = change["row"]
        table[row, column] = value
    options = {key: change[key] for key in ("header", "delimiter") if key in change}
    with pytest.raises(InputError, match=rf"r\.csv.*{message}") as error:
        read_recording(write(tmp_path, table, **options), robot, change.get("columns"))
    assert "\n" not in str(error.value)


def test_log_of_1_hz_is_refused_without_another_unit_unless_it_lasts_long_in_it(tmp_path, robot):
    for rows, is_hinted in ((600, False), (60_000, True)):
        values = np.column_stack([np.arange(float(rows)), np.ones((rows, 8))])
        with pytest.raises(InputError, match=r"time: .*, 1 Hz, expected 5 to 100000 Hz") as error:
            read_recording(write(tmp_path, values), robot, Columns())
        assert ("in milliseconds it would be 1000 Hz" in str(error.value)) == is_hinted


@needs_data
def test_ur10_recording_is_identified_as_by_another_calculation(tmp_path):
    robot = load_robot(UR10.write(tmp_path))
    recorded = read_recording(DATA / "ur10/exciting.csv", robot)
    found = identify(robot, [recorded], held_out=0.3, cutoff=8.0)
    assert len(found.estimate.beta) == 40  # 58 with viscous and Coulomb friction and an offset
    # Another calculation leaves 14.3 6.0 5.1 10.7 7.8 16.6 %, with Coulomb friction.
    left = 100 * found.left(found.predicted, held_out=True)
    assert np.all(left < [8, 7.5, 5.1, 10.7, 10, 16.6]), left


def logged(folder, rows, robot, columns=None, end="\n"):
    path = folder / "r.csv"
    path.write_text("\n".join(rows) + end)
    return read_recording(path, robot, columns)


def test_text_columns_are_ignored(tmp_path, table, robot):
    """Loggers add modes and frames; other cells that are no numbers stay refused."""
    first, *lines = write(tmp_path, table, header=f"{HEADER},mode").read_text().splitlines()

    def with_ends(*ends):
        return [first, *(f"{line},{end}" for line, end in zip(lines, ends, strict=True))]

    recorded = logged(tmp_path, with_ends("INIT", "2", *['"RUN NING"'] * (N - 2)), robot)
    np.testing.assert_allclose(recorded.signals["tau"], table[:, 5:], rtol=1e-14)
    late = with_ends("1", *["RUN"] * (N - 1))
    np.testing.assert_array_equal(logged(tmp_path, late, robot).signals["tau"], table[:, 5:])
    used = Columns(v=("10", "3", "4", "5"))
    with pytest.raises(InputError, match="line 3: 'RUN' is not a number"):
        logged(tmp_path, late, robot, used)
    comma = [x.replace(".", "x").replace(",", ";").replace("x", ",") for x in [HEADER, *lines]]
    with pytest.raises(InputError, match=r"line 2: '.*,.*' is not a number, .*decimal: comma"):
        logged(tmp_path, comma, robot, Columns(delimiter="semicolon"))


DATES = {
    "ISO 8601": lambda x: x.isoformat(),
    "a space": lambda x: x.isoformat(sep=" ", timespec="milliseconds") + "+01:00",
    "points": lambda x: x.strftime("%d.%m.%Y %H:%M:%S.%f"),
    "slashes": lambda x: x.strftime("%m/%d/%Y %H:%M:%S.%f"),
    "time of day": lambda x: x.time().isoformat(),
}


@pytest.mark.parametrize("form", DATES)
def test_time_may_be_a_date_or_a_time_of_day_over_midnight(tmp_path, table, robot, form):
    begin = datetime(2025, 3, 14, 23, 59, 59, 980_000)
    dated = [DATES[form](begin + timedelta(seconds=x)) for x in table[:, 0]]
    lines = write(tmp_path, table).read_text().splitlines()
    rows = [HEADER, *(f"{x},{y.partition(',')[2]}" for x, y in zip(dated, lines[1:], strict=True))]
    recorded = logged(tmp_path, rows, robot)
    np.testing.assert_allclose(recorded.time, table[:, 0], atol=1e-6)
    np.testing.assert_array_equal(recorded.signals["tau"], table[:, 5:])
    with pytest.raises(
        InputError, match=r"time_factor: 0\.001, expected 1, since time of .* dates"
    ):
        logged(tmp_path, rows, robot, Columns(time_factor=1e-3))
    with pytest.raises(InputError, match="time has dates, expected numbers"):
        logged(tmp_path, rows, robot, Columns(time="", rate=100, tau=("1", "7", "8", "9")))
    rows[2] = rows[2].replace(dated[1], "soon")
    with pytest.raises(InputError, match="line 3: time is 'soon', expected a number, a date or"):
        logged(tmp_path, rows, robot)


PROPOSED = [
    ("Zeit[ms];Achse{}.Ist_deg;Achse{}.Motormoment", 1, "Achse1.Ist_deg",
     "side: motor"),
    ("timestamp,actual_q_{},actual_current_{}", 0, "actual_q_0", "a current, which needs torque"),
    ("# t;pos A{};vel A{};torque A{}", 1, "pos A1", "q: pos A{k}, v: vel A{k}, tau: torque A{k}"),
    ("time;joint_{}_angle;tau_{};zz", 1, "joint_1_angle", "q: joint_{k}_angle"),
]  # fmt: skip


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "latin-1"])
@pytest.mark.parametrize("names, first, q, part", PROPOSED, ids=[case[0] for case in PROPOSED])
def test_proposed_columns_read_the_refused_file(
    tmp_path, table, robot, names, first, q, part, encoding
):
    mark, german = ";" if ";" in names else ",", "Zeit" in names
    header = mark.join(
        x.format(k) if "{}" in x else x.replace("[", "\u00b0[" if encoding == "latin-1" else "[")
        for x in names.split(mark)
        for k in (range(first, first + 4) if "{}" in x else [0])
    )
    values = np.hstack([table, table[:, 1:]])[:, : header.count(mark) + 1]
    values = values * [1e3 if german else 1, *np.ones(values.shape[1] - 1)]
    path = write(tmp_path, values, header, mark, encoding, "," if german else ".")
    with pytest.raises(InputError) as error:
        read_recording(path, robot)
    text = str(error.value)
    assert f"q_1 is probably '{q}'" in text and part in text.replace("'", "")
    mapping = tmp_path / "columns.yaml"
    mapping.write_text(text.partition("mapping file (columns=...): ")[2], "utf-8")
    recorded = read_recording(path, robot, load_columns(mapping))
    np.testing.assert_allclose(recorded.time, table[:, 0], atol=1e-12)
    angle = np.radians(table[:, 1:5]) if german else table[:, 1:5]
    np.testing.assert_allclose(recorded.signals["q"], angle)


def test_empty_columns_and_cut_last_line_are_left_out(tmp_path, table, robot):
    lines = write(tmp_path, table, header=f"{HEADER},spare").read_text().splitlines()
    empty = [lines[0], *(f"{line}," for line in lines[1:])]
    for rows in (empty, [*empty[:-1], f"{empty[-1]}7"], [HEADER, *empty[1:]]):
        recorded = logged(tmp_path, rows, robot)
        np.testing.assert_allclose(recorded.signals["tau"], table[:, 5:])
        assert recorded.notes == ()
    for cut in (empty[-1][:40], f"{lines[-1]},-"):
        recorded = logged(tmp_path, [*empty[:-1], cut], robot, end="")
        np.testing.assert_allclose(recorded.signals["tau"], table[:-1, 5:])
        assert "0.04" in recorded.notes[0]
    with pytest.raises(InputError, match=r"line 3: .*value\(s\), expected 10"):
        logged(tmp_path, [*empty[:2], empty[2][:40], *empty[3:]], robot)
    with pytest.raises(InputError, match="line 6: tau_1 is nan"):
        logged(tmp_path, [*empty[:-1], lines[-1].replace(lines[-1].split(",")[5], "") + ","], robot)


def test_matlab_files_of_others_are_read_by_the_proposed_mapping(tmp_path, table, robot):
    """Signals in a structure, joints by rows or by columns, and matrices of no concern."""
    log = {"q": table[:, 1:5].T, "torque": table[:, 5:]}
    data = {"log": log, "t": table[:, 0], "Ts": 0.01, "masses": np.ones((2, 3))}
    savemat(tmp_path / "r.mat", data)
    with pytest.raises(InputError) as error:
        read_recording(tmp_path / "r.mat", robot)
    mapping, text = tmp_path / "columns.yaml", str(error.value)
    assert "log.torque" in text
    mapping.write_text(text.partition("mapping file (columns=...): ")[2], "utf-8")
    recorded = read_recording(tmp_path / "r.mat", robot, load_columns(mapping))
    np.testing.assert_array_equal(recorded.time, table[:, 0])
    np.testing.assert_array_equal(recorded.signals["q"], table[:, 1:5])
    np.testing.assert_array_equal(recorded.signals["tau"], table[:, 5:])
