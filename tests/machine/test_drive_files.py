"""What drives read: integers from a motion, files, and what a loop makes of them."""

import csv
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from helpers.drive_readers import read_cam, read_csv, read_st, read_trajectory
from markdown_it import MarkdownIt

from sdt_drake.cli.app import main
from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import read_table
from sdt_drake.machine.drive_files import formats
from sdt_drake.machine.drive_files.drives import Axis, Drives, load_drives
from sdt_drake.machine.drive_files.export import play_back, write_files
from sdt_drake.machine.drive_files.formats import write_drive_table
from sdt_drake.machine.drive_files.set_points import SetPoints, samples_from, samples_of, set_points
from sdt_drake.motion import LearnedReference, Motion
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.run.controllers import CONTROLLERS, Pi
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import simulate

R = np.array([67.2, 1, 1, 1])
ROTOR = np.array([0.1291, 1.73, 0.531, 0.531])
RATED = np.array([68.0, 1800, 960, 960])


@pytest.fixture(scope="module")
def motion():
    """0.6 s from rest to rest: joint 1 there and back, joints 2 and 4 at different speeds."""
    t = np.arange(121) * 0.005
    hump = np.sin(np.pi * t / 0.6) ** 2
    v = np.stack([0.1 * hump * np.cos(np.pi * t / 0.6), 0.4 * hump, 0 * t, -1.3 * hump], axis=1)
    return Motion.from_speeds(0.005, np.array([0.1, -0.2, 0.3, 0.0]), v)


def drives_with(cycle_time=0.001, **fields):
    given = {"rated_torque": RATED, **fields}
    each = [dict(zip(given, values, strict=True)) for values in zip(*given.values(), strict=True)]
    axes = [Axis(**{"increments": 2**20, **own}) for own in each]
    return Drives(cycle_time=cycle_time, axes=axes)


def test_resampled_points_lie_on_the_trajectory(robot, motion):
    samples = samples_of(robot, motion, 0.0007)
    t = np.minimum(np.arange(len(samples.q)) * 0.0007, motion.duration)
    assert 0 <= t[-1] - t[-2] <= 0.0007 and t[-1] == motion.duration
    np.testing.assert_allclose(samples.q, motion.trajectory.vector_values(t).T, atol=1e-12)
    speeds = [np.interp(t, motion.time, column) for column in motion.v.T]
    np.testing.assert_allclose(samples.v, np.transpose(speeds), atol=1e-12)
    own = samples_of(robot, motion, motion.period)
    links = torque_groups(robot, motion.q, motion.v, motion.vd).total
    np.testing.assert_allclose(own.tau, links + R**2 * ROTOR * motion.vd, atol=1e-8)


@pytest.mark.parametrize(
    ("unit", "per_turn_and_second"), [("increments/s", 2**20), ("rpm", 60), ("0.001 rpm", 60_000)]
)
def test_set_points_round_the_motion_without_drift(robot, motion, unit, per_turn_and_second):
    signs, zero, ratio = [1, -1, 1, -1], [0, 7, -500, 2**20], [67.2, 2, 1, 1]
    drives = drives_with(speed_unit=[unit] * 4, sign=signs, zero=zero, gear_ratio=ratio)
    samples = samples_of(robot, motion, 0.001)
    points = set_points(robot, drives, samples)
    turns = samples.q * [67.2, -2, 1, -1] / (2 * np.pi)
    exact = turns * 2**20 + [0, 7, -500, 2**20]
    assert np.abs(points.position - exact).max() <= 0.5 + 1e-6
    # Speeds add up to the positions: to half a unit for one cycle, and the half of rounding.
    in_increments = points.speed[:-1] / per_turn_and_second * 2**20 * 0.001
    travelled = points.position[0] + np.vstack([np.zeros(4), np.cumsum(in_increments, axis=0)])
    slack = 1 + 2**20 * 0.001 / per_turn_and_second
    assert np.abs(travelled - points.position).max() <= slack
    back = samples_from(robot, drives, points, motion.q[0])
    turns_per_second = back.v * [67.2, -2, 1, -1] / (2 * np.pi)
    np.testing.assert_allclose(turns_per_second * per_turn_and_second, points.speed, atol=1e-6)
    per_mille = 1000 * samples.tau / ([67.2, -2, 1, -1] * RATED)
    assert np.abs(points.torque - per_mille).max() <= 0.5 + 1e-9


def test_axes_may_read_different_objects(robot, motion, tmp_path):
    """A speed drive follows the same way from where it stands, which a file of speeds alone does
    not tell; a position drive knows no torque."""
    objects = [["60FFh", "6071h"], ["607Ah"], ["607Ah", "60B1h", "60B2h"], ["60FFh"]]
    drives = drives_with(objects=objects, zero=[10**6, 0, 7, 10**7])
    samples = samples_of(robot, motion, drives.cycle_time)
    points = set_points(robot, drives, samples)
    formats.write_csv(tmp_path / "a.csv", drives, points)
    header = (tmp_path / "a.csv").read_text().split("\n")[0]
    assert header == "cycle,607Ah_2,607Ah_3,60FFh_1,60FFh_4,60B1h_3,60B2h_3,6071h_1"
    points = read_csv(tmp_path / "a.csv", drives)
    read = samples_from(robot, drives, points, samples.q[0])
    np.testing.assert_array_equal(read.tau[:, [1, 3]], 0)
    np.testing.assert_allclose(read.q, samples.q, atol=1e-5)


# --- files -----------------------------------------------------------------------------------


@pytest.mark.oracle
def test_structured_text_parses_with_blark(robot, motion, tmp_path):
    """blark parses what IEC 61131-3 and TwinCAT take; slowly, so a few cycles."""
    blark = pytest.importorskip("blark")
    drives = drives_with()
    points = set_points(robot, drives, samples_of(robot, motion, drives.cycle_time))
    few = SetPoints(points.position[:2], points.speed[:2], points.torque[:2])
    formats.write_st(tmp_path / "p.st", drives, few, points, "a (* title *)")
    text = (tmp_path / "p.st").read_text(encoding="utf-8")
    assert "TargetPosition[4] := TargetPosition_4[Cycle];" in text
    (block,) = blark.parse_source_code(text).transform().items
    assert str(block.name) == "SdtMotion"


def test_cam_table_stays_within_tolerance_with_few_points(robot, motion, tmp_path):
    drives = drives_with(sign=[1, -1, 1, -1], zero=[0, 7, -500, 2**20])
    samples, path = samples_of(robot, motion, drives.cycle_time), tmp_path / "cam.csv"
    off = []
    for count in (5, 50, 10_000):  # as many points as cycles leave the rounding
        formats.write_cam(path, formats.cam_table(robot, drives, samples, count))
        read = read_cam(path, robot, drives)
        assert len(path.read_text().splitlines()) == 1 + min(count, len(samples.q))
        assert read.q.shape == samples.q.shape and not read.tau.any()
        off.append(np.abs(read.q - samples.q).max())
    assert off[2] < 4e-6 and off[1] < 1e-4 < off[0] < 0.05


def test_trajectory_numbers_stay_numbers_in_yaml(robot, motion, tmp_path):
    own = samples_of(robot, motion, motion.period)
    own.q[0] = -1e-05, 2e16, 5e-324, 1.5e-07
    formats.write_trajectory(tmp_path / "t.yaml", robot, own, motion.vd, effort=True)
    message = yaml.safe_load((tmp_path / "t.yaml").read_text(encoding="utf-8"))
    assert message["points"][0]["positions"] == [-1e-05, 2e16, 5e-324, 1.5e-07]
    np.testing.assert_array_equal(read_trajectory(tmp_path / "t.yaml", robot).q, own.q)


def test_drive_table_is_motor_side_with_whole_torque(robot, motion, tmp_path):
    write_drive_table(tmp_path / "d.csv", robot, samples_of(robot, motion, motion.period))
    time, columns = read_table(tmp_path / "d.csv")
    np.testing.assert_array_equal(time, motion.time)
    np.testing.assert_allclose(columns["q_motor"], R * motion.q)
    np.testing.assert_allclose(columns["v_motor"], R * motion.v)
    links = torque_groups(robot, motion.q, motion.v, motion.vd).total
    np.testing.assert_allclose(columns["tau_motor"], links / R + ROTOR * R * motion.vd, atol=1e-8)


# --- bad input -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"increments": [2**32] * 4}, "joint 1 'planetary' at .* s: position of .* increments"),
        ({"zero": [0, 2**32, 0, 0]}, "joint 2 'roll' at 0.000 s: position of"),
        ({"rated_torque": [0.01, 1e3, 1e3, 1e3]}, "per mille .*, its drive accepts 32767"),
        ({"maximum_torque": [1e4, 1e4, 1e4, 1.0]}, "joint 4 'yaw' .* torque of .* accepts 1$"),
    ],
)
def test_set_points_beyond_a_drive_are_refused(robot, motion, fields, told):
    drives = drives_with(**fields)
    with pytest.raises(InputError, match=told):
        set_points(robot, drives, samples_of(robot, motion, 0.001))


def test_unread_objects_may_exceed_their_bits(robot, motion):
    """A speed drive turns on and on; only what its motor can give is a bound for every drive."""
    samples, unread = samples_of(robot, motion, 0.001), [["607Ah"], ["60FFh"]] * 2
    rated = {"rated_torque": [1e-3, 1e3, 1e3, 1e3]}
    set_points(robot, drives_with(objects=unread, zero=[0, 2**32, 0, 0], **rated), samples)
    with pytest.raises(InputError, match=r"joint 1 .* torque of .*, its drive accepts 1000$"):
        set_points(robot, drives_with(objects=unread, maximum_torque=[1e-3] * 4, **rated), samples)


AXIS = "{increments: 4096, rated_torque: 10"


@pytest.mark.parametrize(
    ("axis", "told"),
    [
        (AXIS + ", sign: 0}", r"axes\[1\].sign: 0, expected 1 or -1"),
        (AXIS + ", objects: [607Ah, 607Ah]}", r"objects\[2\]: 607Ah is given twice"),
        (AXIS + ", objects: [60B1h]}", "neither a position nor a speed"),
        (AXIS + "}, " + AXIS + "}", r"axes: 2 value\(s\), expected 1, one for each joint"),
    ],
)
def test_bad_drive_fields_are_refused(tmp_path, axis, told):
    (tmp_path / "d.yaml").write_text(f"cycle_time: 0.001\naxes: [{axis}]\n")
    with pytest.raises(InputError, match=told):
        load_drives(tmp_path / "d.yaml", 1)


def test_function_block_rests_until_started(robot, tmp_path):
    """A motion that accelerates from its first sample on; joint 2 holds the links against
    gravity."""
    t = np.arange(41)[:, None] * 0.005
    v = np.minimum(t, 0.2 - t) * [0.3, 0.5, 0, -2]
    motion = Motion.from_speeds(0.005, np.array([0.1, 0.7, 0.3, 0.2]), v)
    design = make_design(Scenario(controller=Pi(omega_r=66.0)), robot=robot, motion=motion)
    drives = drives_with(zero=[0, 7, -500, 2**20])
    write_files(design, drives, tmp_path, cam_points=50, title="x")
    text = (tmp_path / "set_points.st").read_text(encoding="utf-8")
    rests = text.split("\nELSE\n")[1].split("\nEND_IF")[0]
    names = "TargetPosition", "VelocityOffset", "TorqueOffset"
    said = {x: [int(y) for y in re.findall(rf"{x}\[\d\] := (-?\d+);", rests)] for x in names}
    first = read_csv(tmp_path / "set_points.csv", drives)
    weight = torque_groups(robot, design.reference.tracked.q[:1], 0 * v[:1], 0 * v[:1]).gravity[0]
    assert said["TargetPosition"] == first.position[0].tolist()
    assert said["VelocityOffset"] == [0] * 4 and first.speed[0].any()
    np.testing.assert_allclose(said["TorqueOffset"], 1000 * weight / (R * RATED), atol=0.51)
    assert said["TorqueOffset"][1] != 0 and abs(first.torque[0] - said["TorqueOffset"]).max() > 10


def test_names_are_escaped_in_the_read_me(robot, motion, tmp_path):
    """No tag, link or further cell; the page is read as GitHub reads it, with HTML on."""
    names = ('<img src=x onerror="alert(1)">|x', "[a](javascript:b)", "<script>`&lt;", "a\\|b")
    design = make_design(Scenario(controller=Pi(omega_r=66)), robot=robot, motion=motion)
    design = replace(design, nominal=replace(robot, joint_names=names))
    write_files(design, drives_with(), tmp_path, cam_points=50, title=names[0])
    reader = MarkdownIt("commonmark").enable("table")
    tokens = reader.parse((tmp_path / "README.md").read_text(encoding="utf-8"))
    parts = [part for token in tokens for part in token.children or [token]]
    assert not [x for x in parts if x.type in ("html_inline", "html_block", "image", "link_open")]
    cells = ["".join(x.content for x in y.children) for y in tokens if y.type == "inline"]
    assert all(cells.count(name) == 2 for name in names)
    assert cells[0] == f"{names[0]}: set points for drives"


@pytest.mark.parametrize("effort", [False, True])
def test_exported_files_hold_the_set_points_of_the_loop(robot, motion, tmp_path, effort):
    """The trajectory has torques only if asked: ROS 2 rejects them for robots that take none."""
    design = make_design(Scenario(controller=Pi(omega_r=66.0)), robot=robot, motion=motion)
    drives = drives_with(sign=[1, -1, 1, -1], zero=[0, 7, -500, 2**20])
    exported = write_files(design, drives, tmp_path, cam_points=50, title="x", effort=effort)
    assert ("effort" in (tmp_path / "trajectory.yaml").read_text()) == effort
    cam = read_cam(tmp_path / "cam.csv", robot, drives)
    for read, made in (
        (read_csv(tmp_path / "set_points.csv", drives), exported.points),
        (read_st(tmp_path / "set_points.st", drives), exported.points),
        (read_trajectory(tmp_path / "trajectory.yaml", robot), exported.own),
        (cam, formats.samples_from_cam(robot, drives, exported.cam)),
    ):
        for name, values in vars(made).items():
            np.testing.assert_allclose(getattr(read, name), values, rtol=1e-9, err_msg=name)
    np.testing.assert_allclose(cam.q, exported.samples.q, atol=1e-4)
    np.testing.assert_array_equal(exported.own.q, motion.q)
    back = samples_from(robot, drives, exported.points, motion.q[0])
    np.testing.assert_allclose(back.q, exported.samples.q, atol=2e-5)  # 2**20 / turn, and drift


# --- what a loop makes of the files ------------------------------------------------------------


def test_export_tells_the_errors_of_a_loop_on_its_files(tmp_path, capsys, monkeypatch, motion):
    monkeypatch.chdir(tmp_path)
    motion.to_csv("m.csv")
    drive = "drives"
    assert main(["export", "m.csv", "--drive", drive, "--out", "x", "--cam-points", "60"]) == 0
    assert "cycle of 1 ms" in capsys.readouterr().out
    with (tmp_path / "x" / "read_back.csv").open() as file:
        rows = list(csv.DictReader(file))
    error = {}
    for row in rows:
        found = float(row["position_error_rad"])
        error[row["source"]] = max(found, error.get(row["source"], 0.0))
    # Set points command the mean speed of a cycle: the lag of half a hold is gone.
    assert error["set_points.csv"] == error["set_points.st"] < 0.2 * error["motion"]
    assert error["trajectory.yaml"] == pytest.approx(error["motion, no torque"], rel=1e-3)
    assert error["cam.csv"] == pytest.approx(error["motion, no torque"], rel=0.2)


@pytest.mark.parametrize(("kind", "has_torque"), [("p_pi", True), ("p_pi", False), ("pi_id", True)])
def test_learned_torque_is_exported_as_flown(tmp_path, robot, motion, kind, has_torque):
    """With the torques that were fed forward beside it, and no others; errors are those against
    the planned motion, as `simulate` tells them."""
    scenario = Scenario(controller=CONTROLLERS[kind](omega_r=66.0))
    design = make_design(scenario, robot=robot, motion=motion)
    beside = motion.v + 2e-3 * np.sin(2 * np.pi * motion.time / 0.6)[:, None] ** 2
    beside[-1] = 0
    torque = 30 * np.sin(np.pi * motion.time / 0.6)[:, None] * [0.1, 1, 1, 1]
    beside = Motion.from_speeds(motion.period, motion.q[0], beside)
    design = design.given(LearnedReference(beside, torque if has_torque else None))
    drives = drives_with(0.005)
    exported = write_files(design, drives, tmp_path, cam_points=50, title="x", effort=True)
    along = design.tuning.feedforward.along
    fed = np.zeros_like(torque) if along is None else along
    np.testing.assert_array_equal(fed, torque * has_torque if kind == "p_pi" else fed)
    told = read_csv(tmp_path / "set_points.csv", drives).torque
    np.testing.assert_allclose(told, 1000 * fed / RATED, atol=0.51)
    flown = np.abs(simulate(design).position_error).max(axis=0)
    errors = {x.source: x.position_error for x in play_back(design, drives, exported)}
    np.testing.assert_allclose(errors["motion"], flown, rtol=5e-3, atol=1e-9)
    np.testing.assert_allclose(errors["trajectory.yaml"], flown, rtol=5e-3, atol=1e-9)
