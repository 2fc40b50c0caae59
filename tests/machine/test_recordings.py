"""Recordings in files of others, what is said of bad ones, and one of a real robot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dh import DATA, UR10, needs_data
from scipy.io import savemat

from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import check
from sdt_drake.machine.identify.filtering import stretches
from sdt_drake.machine.identify.model import identified_robot
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.recordings import Columns, Recorded, load_columns, read_recording
from sdt_drake.robot.robot import load_robot

N, DEG = 5, np.pi / 180


@pytest.fixture
def table():
    """Time, q and tau of four joints, side by side."""
    rng = np.random.default_rng(3)
    return np.column_stack([0.01 * np.arange(N), rng.normal(size=(N, 8))])


def write(folder, table, header="time,q_1,q_2,q_3,q_4,tau_1,tau_2,tau_3,tau_4", delimiter=","):
    path = folder / "r.csv"
    with path.open("w") as file:
        file.write(f"{header}\n" if header else "")
        np.savetxt(file, table, delimiter=delimiter, fmt="%.17g")
    return path


def test_a_text_without_header_of_motors_in_degrees(tmp_path, table, robot):
    mapping = tmp_path / "columns.yaml"
    mapping.write_text(
        "header: false\ndelimiter: space\ntime: '1'\ntime_factor: 1.0e-3\n"
        "q: ['2', '3', '4', '5']\nv: []\ntau: ['6', '7', '8', '9']\nangle: deg\nside: motor\n"
        "position_offset: [0, 0.5, 0, 0]\ndirection: [1, -1, 1, 1]\ntorque_factor: [2, 2, 2, 2]\n"
    )
    path = write(tmp_path, table, header="", delimiter="  ")
    recorded = read_recording(path, robot, load_columns(mapping))
    turned = [1, -1, 1, 1]
    np.testing.assert_allclose(recorded.time, 1e-3 * table[:, 0], atol=1e-18)
    np.testing.assert_allclose(
        recorded.signals["q"], table[:, 1:5] * DEG * turned + [0, 0.5, 0, 0], rtol=1e-14
    )
    np.testing.assert_allclose(
        recorded.signals["tau"], table[:, 5:] * 2 * robot.gear_ratio * turned, rtol=1e-14
    )
    assert set(recorded.signals) == {"q", "tau"}
    asked = replace(load_columns(mapping), q_ref=["2", "3", "4", "5"])
    np.testing.assert_array_equal(
        read_recording(path, robot, asked).signals["q_ref"], recorded.signals["q"]
    )


def test_side_of_own_recordings_is_known(tmp_path, table, robot):
    own = "time,q_1,q_2,q_3,q_4,tau_1,tau_2,tau_3,tau_4,tau_cmd_1,tau_limited_1,load_torque_1"
    path = write(tmp_path, np.column_stack([table, np.ones((N, 3))]), header=own)
    recorded = read_recording(path, robot)
    np.testing.assert_allclose(recorded.signals["tau"], table[:, 5:9] * robot.gear_ratio)


def test_torques_that_are_late_are_put_at_their_time(tmp_path, table, robot):
    path = write(tmp_path, table)
    late = read_recording(path, robot, Columns(torque_delay=0.01)).signals["tau"]
    np.testing.assert_allclose(late[:-1], table[1:, 5:])  # a sample of 10 ms
    np.testing.assert_array_equal(late[-1], table[-1, 5:])


HEADER = "time,q_1,q_2,q_3,q_4,tau_1,tau_2,tau_3,tau_4"
BAD = [
    ({"header": HEADER.replace("tau_1", "i_1")}, r"no column 'tau_1' \(tau\), there are time, q_1"),
    ({"header": HEADER.replace("tau_4", "x")}, r"3 column\(s\) tau_k \(tau\), but the robot has 4"),
    ({"header": HEADER.replace("tau_4", "q_5")}, r"5 or more column\(s\) q_k \(q\), but the robot"),
    ({"header": HEADER.replace("tau_2", "x")}, r"3 column\(s\) tau_k \(tau\), but the robot"),
    ({"header": HEADER.replace("tau_1", "v_2")}, r"no column 'v_1' \(v\), there are time, q_1"),
    ({"header": HEADER.replace("time", "t")}, r"no column 'time' \(time\)"),
    ({"row": (2, 0, 0.0)}, r"line 4: time goes from 0.01 to 0, expected a growing time"),
    ({"row": (2, 0, 0.01)}, r"line 4: time goes from 0.01 to 0.01, expected a growing time"),
    ({"row": (3, 6, np.nan)}, r"line 5: tau_2 is nan, expected a finite number"),
    ({"delimiter": ";"}, r"line 2: 1 value\(s\), expected 9"),
    ({"header": HEADER.replace("tau_1", "q_1")}, r"2 columns 'q_1', expected one; give its number"),
    (
        {"columns": Columns(q=["2", "3", "2", "5"])},
        r"q: 2 and 2 are the same column, expected one for",
    ),
    ({"columns": Columns(q=["q_1", "q_2", "q_3", "4"])}, r"q: q_3 and 4 are the same column"),
    (
        {"columns": Columns(q_ref=["wish_{k}"])},
        r"no column 'wish_1' \(q_ref\), there are time, q_1",
    ),
    (
        {"columns": Columns(tau_ff=["a", "b", "c", "d"])},
        r"no column 'a' \(tau_ff\), there are time",
    ),
    (
        {"scale": 1e3},
        r"time: 5 samples in 40 s, 0.1 Hz, .*in milliseconds it .* 100 Hz, time_factor: 0.001 in",
    ),
    ({"scale": 1e6}, r"microseconds it would be 100 Hz, time_factor: 1e-06 in the mapping file"),
    ({"scale": 1e9}, r"nanoseconds it would be 100 Hz, time_factor: 1e-09 in the mapping file"),
    ({"scale": 1 / 86400}, r"in days it would be 100 Hz, time_factor: 86400 in the mapping file"),
    (
        {"columns": Columns(time_factor=1e-6)},
        r"expected 5 to 100000 Hz; in seconds .* time_factor: 1 ",
    ),
    (
        {"columns": Columns(time="", rate=0.005)},
        r"rate: 5 samples in 800 s, .*; rate: 200 in the map",
    ),
    ({"columns": Columns(time="", rate=1.0)}, r"; rate: 1000 in the mapping file"),
]


@pytest.mark.parametrize("change, message", BAD, ids=[case[-1] for case in BAD])
def test_bad_recordings_are_refused_in_one_line(tmp_path, table, robot, change, message):
    table[:, 0] *= change.get("scale", 1)
    if "row" in change:
        row, column, value = change["row"]
        table[row, column] = value
    options = {key: change[key] for key in ("header", "delimiter") if key in change}
    with pytest.raises(InputError, match=rf"r\.csv.*{message}") as error:
        read_recording(write(tmp_path, table, **options), robot, change.get("columns"))
    assert "\n" not in str(error.value)


def test_bad_mappings_are_refused():
    with pytest.raises(InputError, match="rate: missing"):
        check(Columns(time=""))
    with pytest.raises(InputError, match=r"direction: .*expected 1 and -1"):
        check(Columns(direction=[1.0, 0.5]))


def test_the_longest_gap_is_told_with_its_place():
    time = np.concatenate([np.arange(300), np.arange(310, 1000), np.arange(1200, 2000)]) / 100
    still = np.zeros((len(time), 1))
    parts, notes = stretches(Recorded(Path("r.csv"), time, {"q": still, "tau": still}))
    assert len(parts) == 3
    assert notes[0].startswith("2 gap(s) in time, the longest 2.01 s at 9.99 s")


@needs_data
def test_ur10(tmp_path):
    robot = load_robot(UR10.write(tmp_path))
    recorded = read_recording(DATA / "ur10/exciting.csv", robot)
    found = identify(robot, [recorded], held_out=0.3, cutoff=8.0)
    assert len(found.estimate.beta) == 40  # 58 with viscous and Coulomb friction and an offset
    # Another calculation leaves 14.3 6.0 5.1 10.7 7.8 16.6 %, with Coulomb friction.
    left = 100 * found.left(found.predicted, held_out=True)
    assert np.all(left < [8, 7.5, 5.1, 10.7, 10, 16.6]), left
    assert np.all(100 * found.left(found.equations.nominal, held_out=True) > 30)
    assert load_robot(UR10.write(tmp_path)).n == identified_robot(found).n


def test_columns_of_texts_are_no_concern_of_others(tmp_path, table, robot):
    """Loggers add modes and frames; what is no text stays refused, as a comma in a number is."""
    path = write(tmp_path, table, header=f"{HEADER},mode")
    first, *lines = path.read_text().splitlines()

    def logged(ends):
        rows = (f"{line},{end}" for line, end in zip(lines, ends, strict=True))
        path.write_text("\n".join([first, *rows]) + "\n")
        return read_recording(path, robot)

    recorded = logged(["INIT", "2", *['"RUN NING"'] * (N - 2)])
    np.testing.assert_allclose(recorded.signals["tau"], table[:, 5:], rtol=1e-14)
    with pytest.raises(InputError, match="line 3: 'RUN' is not a number"):
        logged(["1", *["RUN"] * (N - 1)])
    path.write_text(path.read_text().replace(".", "x").replace(",", ";").replace("x", ","))
    with pytest.raises(InputError, match=r"line 2: '.*,.*' is not a number, expected points in"):
        read_recording(path, robot, Columns(delimiter="semicolon"))


def odd(folder, table, *, header, marks=(".", ";"), encoding="utf-8", ends="\n", name="r.csv"):
    """A file of other loggers: decimal mark, delimiter, encoding, ends of lines."""
    rows = [marks[1].join(f"{x:.12g}".replace(".", marks[0]) for x in row) for row in table]
    path = folder / name
    path.write_text(ends.join([header, *rows]) + ends, encoding=encoding)
    return path


GERMAN = "Zeit[ms];" + ";".join(
    [f"Achse{k}.Ist_deg" for k in range(1, 5)] + [f"Achse{k}.Motormoment" for k in range(1, 5)]
)
MAPPING = (
    "decimal: comma\ndelimiter: semicolon\ntime: Zeit[ms]\ntime_factor: 0.001\n"
    "q: Achse{k}.Ist_deg\ntau: Achse{k}.Motormoment\nangle: deg\nside: motor\n"
)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "latin-1"])
def test_a_spreadsheet_of_elsewhere_is_read_by_what_its_refusal_proposes(
    tmp_path, table, robot, encoding
):
    clocked = table * [1e3, *np.ones(8)]
    header = GERMAN.replace("Zeit", "Zeit\u00b0" if encoding == "latin-1" else "Zeit")
    path = odd(tmp_path, clocked, header=header, marks=(",", ";"), encoding=encoding)
    with pytest.raises(InputError) as error:
        read_recording(path, robot)
    (line,) = error.value.lines
    assert "q_1 is probably 'Achse1.Ist_deg' in degrees, tau_1 is probably 'Achse1.Motor" in line
    mapping = tmp_path / "columns.yaml"
    mapping.write_text(line.partition("as a mapping file (--columns): ")[2], encoding="utf-8")
    columns = load_columns(mapping)
    recorded = read_recording(path, robot, columns)
    assert columns.encoding == encoding and columns.q == ["Achse{k}.Ist_deg"]
    np.testing.assert_allclose(recorded.time, table[:, 0])
    np.testing.assert_allclose(recorded.signals["q"], table[:, 1:5] * DEG)
    np.testing.assert_allclose(recorded.signals["tau"], table[:, 5:] * robot.gear_ratio)


def test_a_pattern_is_a_text_and_motors_may_have_the_positions(tmp_path, table, robot):
    path = odd(tmp_path, table * [1e3, *np.ones(8)], header=GERMAN, marks=(",", ";"))
    mapping = tmp_path / "columns.yaml"
    mapping.write_text(f"{MAPPING}position_side: motor\n")
    recorded = read_recording(path, robot, load_columns(mapping))
    np.testing.assert_allclose(recorded.signals["q"], table[:, 1:5] * DEG / robot.gear_ratio)
    mapping.write_text(MAPPING.replace("delimiter: semicolon\n", "encoding: utf-88\n"))
    with pytest.raises(InputError) as error:
        load_columns(mapping)
    assert [problem.place for problem in error.value.problems] == ["decimal", "encoding"]
    with pytest.raises(InputError, match="expected points in the numbers or decimal: comma"):
        read_recording(path, robot, Columns(delimiter="semicolon", time="1"))


PROPOSED = [
    ("timestamp,actual_q_{},actual_current_{}", 0, "actual_q_0", "a current, which needs torque"),
    ("# t;pos A{};vel A{};torque A{}", 1, "pos A1", "q: pos A{k}, v: vel A{k}, tau: torque A{k}"),
    ("time;joint_{}_angle;tau_{};zz", 1, "joint_1_angle", "q: 'joint_{k}_angle'"),
]


@pytest.mark.parametrize("names, first, q, said", PROPOSED, ids=[case[0] for case in PROPOSED])
def test_columns_are_recognised_by_their_names(tmp_path, table, robot, names, first, q, said):
    mark = ";" if ";" in names else ","
    header = mark.join(
        x.format(k) if "{}" in x else x
        for x in names.split(mark)
        for k in (range(first, first + 4) if "{}" in x else [0])
    )
    wide = np.hstack([table, table[:, 1:]])[:, : header.count(mark) + 1]
    with pytest.raises(InputError) as error:
        read_recording(odd(tmp_path, wide, header=header, marks=(".", mark)), robot)
    assert f"q_1 is probably '{q}'" in str(error.value)
    assert said.replace("'", "") in str(error.value).replace("'", "")


def test_empty_columns_and_a_line_that_was_cut_off(tmp_path, table, robot):
    lines = write(tmp_path, table, header=f"{HEADER},spare").read_text().splitlines()
    path = tmp_path / "r.csv"

    def logged(rows, end="\n"):
        path.write_text("\n".join(rows) + end)
        return read_recording(path, robot)

    empty = [lines[0], *(f"{line}," for line in lines[1:])]
    for rows in (empty, [*empty[:-1], f"{empty[-1]}7"], [HEADER, *empty[1:]]):
        recorded = logged(rows)
        np.testing.assert_allclose(recorded.signals["tau"], table[:, 5:])
        assert recorded.notes == ()
    for cut in (empty[-1][:40], f"{lines[-1]},-"):
        recorded = logged([*empty[:-1], cut], end="")
        np.testing.assert_allclose(recorded.signals["tau"], table[:-1, 5:])
        assert recorded.notes[0].startswith("the last line is incomplete and was ignored: 0.04")
    with pytest.raises(InputError, match=r"line 3: .*value\(s\), expected 10"):
        logged([*empty[:2], empty[2][:40], *empty[3:]])
    with pytest.raises(InputError, match="line 6: tau_1 is nan"):
        logged([*empty[:-1], lines[-1].replace(lines[-1].split(",")[5], "") + ","])


def test_matlab_files_of_others(tmp_path, table, robot):
    path = tmp_path / "r.mat"
    data = {"q": table[:, 1:5].T, "torque": table[:, 5:]}
    savemat(path, {"log": data, "t": table[:, 0], "Ts": 0.01, "masses": np.ones((2, 3))})
    with pytest.raises(InputError, match=r"as a mapping file \(--columns\): ") as error:
        read_recording(path, robot)
    mapping = tmp_path / "columns.yaml"
    mapping.write_text(str(error.value).partition("(--columns): ")[2])
    recorded = read_recording(path, robot, load_columns(mapping))
    np.testing.assert_array_equal(recorded.signals["q"], table[:, 1:5])
    np.testing.assert_array_equal(recorded.signals["tau"], table[:, 5:])
