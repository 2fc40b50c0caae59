"""Logs as loggers write them: what is proposed for a refused file reads it, joints in order."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest
import yaml
from helpers import simulated_recordings as simulated

from sdt_drake.io.errors import InputError
from sdt_drake.machine.diagnose.recording import check_recording
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.machine.recordings.reading import read_recording

JOINTS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint")
ORDER = [2, 1, 0, 3]  # alphabetical, as ROS publishes joints
NAMES = [JOINTS[k] for k in ORDER]
N = 120
T = 0.008 * np.arange(N)
Q = np.sin(T[:, None] * [1.0, 1.3, 1.7, 2.1] + 0.3)
V = np.gradient(Q, T, axis=0)
TAU = np.random.default_rng(0).normal(size=(N, 4)) * [100, 80, 30, 5]
WHOLE = 1_700_000_000
SINCE = 0.993456789 + T  # seconds since WHOLE, which pass a whole second


@pytest.fixture
def arm(robot):
    return replace(robot, joint_names=JOINTS)


def text(head, columns, mark=","):
    """A table with columns of numbers or texts."""
    every = []
    for one in columns:
        values = np.broadcast_to(np.array(one), (N, *np.shape(one)[1:])) if np.ndim(one) else one
        values = [values] * N if isinstance(values, str) else values.tolist()
        every.append([x if isinstance(x, list) else [x] for x in values])
    rows = [mark.join(str(x) for cell in row for x in cell) for row in zip(*every, strict=True)]
    return "\n".join(([mark.join(head)] if head else []) + rows) + "\n"


def numbers_of(name, first=0, count=4):
    return [name.format(k) for k in range(first, first + count)]


def ros(pattern, count=4):
    names = ("name", "position", "velocity", "effort")
    return [pattern.format(name, k) for name in names for k in range(count)]


def dated(form):
    begin = datetime(2025, 3, 14, 23, 59, 59, 500_000)
    return [form(begin + timedelta(seconds=x)) for x in T.tolist()]


SEC, NSEC = np.floor(SINCE).astype(int) + WHOLE, np.round(SINCE % 1 * 1e9).astype(int)
STAMP = WHOLE * 10**9 + np.round(SINCE * 1e9).astype(int)
MS = np.round(1e3 * T, 1)
BY_NAMES = [[NAMES] * N, Q[:, ORDER], V[:, ORDER], TAU[:, ORDER]]
ZERO = np.zeros((N, 1))
LABVIEW = "LabVIEW Measurement\t\nWriter_Version\t2\n***End_of_Header***\t\n"
LISTS = [[f'"{x}"' for x in values] for values in
         ([NAMES] * N, Q[:, ORDER].tolist(), TAU[:, ORDER].tolist())]  # fmt: skip

LOGS = {
    "rostopic echo -p": text(["%time", *ros("field.{}{}")], [STAMP, *BY_NAMES]),
    "ros2 topic echo --csv": text([], [SEC, NSEC, "", *BY_NAMES]),
    "stamps in two columns": text(
        ["header.stamp.sec", "header.stamp.nanosec", *ros("{}[{}]")], [SEC, NSEC, *BY_NAMES]
    ),
    "a jittering clock beside the stamps": text(
        ["Time", "header.stamp.secs", "header.stamp.nsecs", *ros("{}_{}")],
        [WHOLE + np.round(SINCE + 0.003 * np.sin(7 * T / 0.008), 6), SEC, NSEC, *BY_NAMES],
    ),
    "more joints than the robot": text(
        ["stamp", *ros("{}{}", 6)],
        [STAMP, [["a_finger", *NAMES, "z_finger"]] * N]
        + [x for values in BY_NAMES[1:] for x in (ZERO, values, ZERO)],
    ),
    "PlotJuggler": text(
        ["__time", *(f"/joint_states/{x}/{s}" for s in ("effort", "position") for x in NAMES)],
        [WHOLE + np.round(SINCE, 6), TAU[:, ORDER], Q[:, ORDER]],
    ),
    "names without joint": text(
        ["t", *(f"{s}_{x.removesuffix('_joint')}" for s in ("position", "effort") for x in NAMES)],
        [T, Q[:, ORDER], TAU[:, ORDER]],
    ),
    "names alone": text(
        ["t", *NAMES, *(f"{x} effort [Nm]" for x in NAMES)], [T, Q[:, ORDER], TAU[:, ORDER]]
    ),
    "numbers from 0": text(
        ["timestamp", *numbers_of("actual_q_{}"), *numbers_of("actual_current_{}")],
        [100 + T, Q, TAU], " ",
    ),
    "lists": text(["Time", "name", "position", "effort"], [WHOLE + np.round(SINCE, 6), *LISTS]),
    "a scope's header": "Name;Scope 1\nFile;x\n" + text(
        ["Name", *numbers_of("Axis {}.ActPos", 1), *numbers_of("Axis {}.ActTorque", 1)],
        [MS, np.degrees(Q), TAU], "\t",
    ),
    "a row of units": ",".join(["Clock", *numbers_of("pos{}", 1), *numbers_of("torque{}", 1)])
    + "\n" + text(["ms", *["deg"] * 4, *["Nm"] * 4], [MS, np.degrees(Q), TAU]),
    "no header": text([], [T, Q, V, TAU], "   "),
    "names with spaces": text(
        ["Time [s]", *numbers_of("Pos {}", 1), *numbers_of("Torque {}", 1)], [T, Q, TAU], "   "
    ),
    "names that run together": "time" + "".join(numbers_of("joint_position_{}[rad]")) + "\n"
    + text([], [T, Q, TAU], "   "),
    "fewer cells than names": LABVIEW
    + text(["X", *numbers_of("Pos {}"), *numbers_of("Torque {}"), "Comment"], [T, Q, TAU], "\t"),
    "dates": text(
        ["stamp", "mode", *numbers_of("q{}", 1), *numbers_of("tau{}", 1)],
        [dated(lambda x: x.isoformat() + "Z"), [""] * 60 + ["run"] * (N - 60), Q, TAU],
    ),
    "date and time of day": text(
        ["Date", "Time", *numbers_of("q{}", 1), *numbers_of("tau{}", 1)],
        ["2025-03-14", dated(lambda x: x.strftime("%H:%M:%S.%f")), Q, TAU],
    ),
}  # fmt: skip


def proposed(path, arm):
    with pytest.raises(InputError) as error:
        read_recording(path, arm)
    told, _, mapping = str(error.value).partition("as a mapping file (columns=...): ")
    return told, Columns(**yaml.safe_load(mapping))


@pytest.mark.parametrize("kind", LOGS)
def test_what_is_proposed_for_a_log_reads_it_in_the_order_of_the_joints(arm, tmp_path, kind):
    path = tmp_path / "log.csv"
    path.write_text(LOGS[kind])
    told, columns = proposed(path, arm)
    assert "120 rows, 0.952 s at 125 Hz, joints over" in told
    recorded = read_recording(path, arm, columns)
    np.testing.assert_allclose(recorded.time, T, atol=1e-6)
    np.testing.assert_allclose(recorded.signals["q"], Q, atol=1e-12)
    np.testing.assert_allclose(recorded.signals["tau"], TAU, atol=1e-12)
    assert not recorded.by_names


def test_positions_of_motors_are_proposed_by_the_torques_of_the_links(tmp_path):
    truth, path = simulated.truth("arm3", 2), tmp_path / "log.csv"
    q, tau = (truth.recorded.signals[x][:3000] for x in ("q", "tau"))
    names = [f"{x}{k}" for x in ("pos", "torque") for k in (1, 2, 3)]
    rows = np.column_stack([truth.recorded.time[:3000], truth.robot.of_motors(q), tau])
    np.savetxt(path, rows, delimiter=",", header=",".join(["t", *names]), comments="")
    told, columns = proposed(path, truth.robot)
    assert "positions of the motors" in told
    read = read_recording(path, truth.robot, columns)
    np.testing.assert_allclose(read.signals["q"], q, atol=1e-9)


def test_nothing_is_proposed_that_does_not_read_the_file(arm, tmp_path):
    path, lists = tmp_path / "lists.csv", [f'"{str(x)[1:-1]}"' for x in Q.tolist()]
    path.write_text(text(["time", "position", "effort"], [T, lists, lists]))
    with pytest.raises(InputError, match=r"line 2: 9 value\(s\), expected 3 as in the first$"):
        read_recording(path, arm)


@pytest.mark.parametrize(
    "form",
    ['"{}"', "{}", '"[np.float64({})]"', "\"array('d', {})\"", '"({})"', '" {} "'],
    ids=["pandas", "bare", "numpy 2", "array", "tuple", "blanks"],
)
@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_cells_of_lists_are_read_as_columns_and_told(arm, tmp_path, form, mark):
    def lists(values):
        inner = "), np.float64(" if "np" in form else ", "
        one = [inner.join(map(str, x)) for x in values.tolist()]
        return [form.format(x if "(" in form and "array" not in form else f"[{x}]") for x in one]

    path = tmp_path / "lists.csv"
    path.write_text(text(["time", "q", "tau"], [T, lists(Q), lists(TAU)], mark))
    recorded = read_recording(path, arm, Columns(delimiter={"\t": "tab"}.get(mark, mark)))
    np.testing.assert_array_equal(recorded.signals["q"], Q)
    np.testing.assert_array_equal(recorded.signals["tau"], TAU)
    assert "'q' holds lists, read as columns q_1 to q_4" in recorded.notes


def test_texts_in_brackets_are_no_lists(arm, tmp_path):
    """A list of another length is refused."""
    path, head = tmp_path / "texts.csv", numbers_of("q_{}", 1) + numbers_of("tau_{}", 1)
    path.write_text(text(["time", *head, "mode"], [T, Q, TAU, "(teach in)"]))
    assert read_recording(path, arm).notes == ()
    rows = text(["time", *head[:4], "tau"], [T, Q, [f'"{x}"' for x in TAU.tolist()]])
    path.write_text(rows.replace("\n", '\n0,0,0,0,0,"[1, 2]"\n', 1))
    with pytest.raises(InputError, match=r"line 3: 9 value\(s\), expected 7 as in the first;"):
        read_recording(path, arm)


def test_rows_with_gaps_are_left_out_if_asked(arm, tmp_path):
    q, tau = Q.copy(), TAU.copy()
    q[5, 1] = tau[7] = np.nan
    path, good = tmp_path / "gaps.csv", np.delete(np.arange(N), [5, 7])
    head = [*numbers_of("q_{}", 1), *numbers_of("tau_{}", 1)]
    path.write_text(text(["time", *head], [T, q, tau]).replace("nan,nan", ",NaN"))
    with pytest.raises(InputError, match=r"line 7: q_2 is nan, .*; or drop_incomplete: true in"):
        read_recording(path, arm)
    for columns in (proposed(path, arm)[1], Columns(drop_incomplete=True, time="", rate=125.0)):
        recorded = read_recording(path, arm, columns)
        np.testing.assert_allclose(recorded.time, T[good], atol=1e-12)
        np.testing.assert_array_equal(recorded.signals["tau"], TAU[good])
        assert recorded.notes == ("2 row(s) that lack a number were left out",)


@pytest.mark.parametrize("first", ["{k}", "{k0}"])
def test_columns_may_be_numbered_from_0_which_is_told_if_it_was_guessed(arm, tmp_path, first):
    path, columns = tmp_path / "r.csv", Columns(q=[f"q{first}"], tau=[f"tau{first}"])
    path.write_text(text(["time", *numbers_of("q{}"), *numbers_of("tau{}")], [T, Q, TAU]))
    recorded = read_recording(path, arm, columns)
    np.testing.assert_array_equal(recorded.signals["tau"], TAU)
    told = ("columns are numbered from 0: joint 1 has q0, tau0",)
    assert recorded.notes == (told if first == "{k}" else ())
    path.write_text(text(["time", *numbers_of("q{}", 0, 5), *numbers_of("tau{}")], [T, Q, T, TAU]))
    with pytest.raises(InputError, match=r"5 or more column\(s\) qk \(q\), but the robot has 4"):
        read_recording(path, arm, columns)


def test_mapping_that_contradicts_the_names_of_joints_is_told_with_their_order(arm, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(LOGS["rostopic echo -p"])
    columns = Columns(
        time="%time", time_factor=1e-9, q=["field.position{k}"], v=[], tau=["field.effort{k}"]
    )
    (found,) = (x for x in check_recording(arm, read_recording(path, arm, columns)) if x.spoils)
    assert found.kind == "order" and str(found).startswith("log.csv: q and tau: joints are swapped")
    right = "q: [field.position2, field.position1, field.position0, field.position3], tau: ["
    assert found.remedy.startswith(right)
