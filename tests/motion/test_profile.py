"""Motion profiles: closed forms of the segments, G and alignment, the library, bad profiles."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.motions import sampled
from helpers.robots import RATE_TABLE, loaded
from helpers.strategies import profiles
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.multibody.tree import JacobianWrtVariable

from sdt_drake.io.errors import InputError
from sdt_drake.motion import Command, Motion, MotionProfile, command_of, load_command
from sdt_drake.motion.profile import Resultant, Track
from sdt_drake.motion.segments import Ramp, Sampled, Turn
from sdt_drake.motion.smooth import Fourier, Spline
from sdt_drake.robot.robot import edited, load_robot

DEVICE = load_robot()


# --- segments --------------------------------------------------------------------------------


def of_yaw(*segments, duration):
    """The command of a profile in which joint 4 moves."""
    track = Track(joint="yaw", segments=list(segments))
    return command_of(MotionProfile(duration=duration, tracks=[track]), DEVICE)


@given(profiles(DEVICE), st.floats(0.01, 0.99))
def test_acceleration_is_the_slope_of_the_speed_within_pieces(profile, share):
    for track in command_of(profile, DEVICE).joints:
        pieces = replace(track, smooth=())
        t, h = pieces.times[:-1] + share * np.diff(pieces.times), 1e-6 * np.diff(pieces.times)
        slope = (pieces.speed(t + h) - pieces.speed(t - h)) / (2 * h)
        np.testing.assert_allclose(pieces.acceleration(t), slope, atol=1e-6, rtol=1e-4)


def test_motion_and_its_command_start_at_the_same_angles():
    motion = Motion.from_speeds(0.5, np.array([1.0, 2.0]), np.array([[0, 3.0], [2, 5], [4, 0]]))
    again = sampled(Command.of_motion("again", motion), 0.5)
    np.testing.assert_array_equal([again.q, again.v], [motion.q, motion.v])


def test_sampled_speeds_are_those_of_their_times():
    profile = Sampled(period=0.5, speeds=[0, 0.2, -0.3, 0])
    v = of_yaw(profile, duration=1.5).speeds(np.array([0.0, 0.25, 0.5, 1.0, 1.25, 1.5]))
    np.testing.assert_allclose(v[:, 3], [0, 0.1, 0.2, -0.3, -0.15, 0], atol=1e-14)


def test_fourier_corners_are_a_sixteenth_of_the_shortest_swing_apart():
    series = Fourier(period=4, sine=[0.3, -0.15], cosine=[0.1, 0.2], end=8)
    np.testing.assert_allclose(series.corners(), np.arange(65) / 8)


def test_spin_needs_an_arm():
    table = Resultant(spin="outer_axis", align="middle_axis")
    profile = MotionProfile(duration=20, tracks=[Track(resultant=table, segments=[BACK])])
    with pytest.raises(InputError, match="'middle_axis' is not on an arm of 'outer_axis'"):
        command_of(profile, loaded(RATE_TABLE, ".urdf"))


def test_fourier_speeds_equal_series_by_hand():
    """Those of knots and swings are in the reference motion."""
    series = Fourier(at=1, period=4, sine=[0.3, -0.15], cosine=[0.1, 0.2], end=8)
    v = of_yaw(series, duration=11.0).speeds(np.array([1.0, 2, 3, 4, 9, 11]))
    expected = np.pi * np.array([0, 0.1, -0.3, 0.2, 0, 0])
    np.testing.assert_allclose(v, expected[:, None] * [0, 0, 0, 1], atol=1e-14)


THROUGH = [[0, 0], [0.5, 40], [1.2, 30], [2, 90]]


def test_spline_passes_all_points_without_a_stop_between():
    """Between points the angle is cubic: its acceleration is linear, and continuous at points."""
    command = of_yaw(Spline(at=1, points=THROUGH), duration=4.0)
    motion = sampled(command, 1e-3)
    times, angles = np.transpose(THROUGH)
    at = np.round((1 + times) / 1e-3).astype(int)
    np.testing.assert_allclose(np.degrees(motion.q[at, 3]), angles, atol=1e-3)
    assert np.all(np.abs(motion.v[at[1:-1], 3]) > 0.1) and not motion.v[at[[0, -1]], 3].any()
    inner, jumps = motion.vd[at[0] : at[-1], 3], at[1:-1] - at[0]
    assert np.abs(np.diff(inner)).max() < 0.1  # rad/s², within 1 ms
    bends = np.abs(np.diff(inner, 2)) > 1e-6
    assert {int(k) for k in np.flatnonzero(bends)} <= {k + d for k in jumps for d in (-2, -1, 0)}


def test_spline_starts_where_its_joint_is():
    with pytest.raises(InputError, match=r"points\[1\]: 5 deg, expected 0 deg, the an"):
        of_yaw(Spline(points=[[0, 5], [1, 10]]), duration=2.0)


@settings(max_examples=15)
@given(profile=profiles(DEVICE), angle=st.floats(-90, 90))
def test_turn_after_any_segments_ends_at_its_angle(profile, angle):
    turn = Turn(to_deg=angle, duration=2)
    tracks = [replace(track, segments=[*track.segments, turn]) for track in profile.tracks]
    profile = replace(profile, tracks=tracks, duration=6)
    motion = sampled(command_of(profile, DEVICE), 1e-3)
    for track in profile.tracks:
        end = motion.q[-1, DEVICE.joint_names.index(track.joint)]
        assert np.degrees(end) == pytest.approx(angle, abs=1e-3)
    np.testing.assert_allclose(np.degrees(motion.q[0]), profile.start_deg)


@given(speed=st.floats(5, 60), most=st.floats(10, 100), by=st.floats(10, 90),
       sign=st.sampled_from([-1, 1]), blend=st.sampled_from(["cosine", "linear"]))  # fmt: skip
def test_ramps_and_turns_reach_their_largest_acceleration_and_speed(speed, most, by, sign, blend):
    command = of_yaw(
        Ramp(to_deg_s=sign * speed, acceleration_deg_s2=most, blend=blend),
        Ramp(to_deg_s=0, duration=1, blend=blend),
        Turn(by_deg=-sign * by, speed_deg_s=speed, blend=blend),
        duration=60.0,
    )
    (_, _, up, _), (_, _, turn, _), (_, _, end, _) = command.timeline
    t = np.linspace(0, 1, 4001)
    v = np.degrees(command.speeds(up * t)[:, 3])
    assert np.abs(np.diff(v)).max() / (up / 4000) == pytest.approx(most, rel=1e-3)
    jerk = np.abs(np.diff(v, 2)).max() / (up / 4000) ** 2
    if blend == "cosine":  # else it jumps at the ends
        assert jerk == pytest.approx(most * np.pi / up, rel=1e-2)
    v = -sign * np.degrees(command.speeds(turn + (end - turn) * t)[:, 3])
    # A quarter of the way: (1 - cos(pi / 2)) / 2, or 3 / 4 of the first third.
    quarter = speed * {"cosine": 0.5, "linear": 0.75}[blend]
    found = v.max(), v.mean() * (end - turn), v[1000]
    assert found == pytest.approx((speed, by, quarter), rel=1e-3)


# --- a commanded G ---------------------------------------------------------------------------


def at_last_joint(robot, motion, i):
    """Specific force [N/kg] at the last joint in the axes of the payload, at constant speed."""
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, [*motion.q[i], *motion.v[i]])
    body, world = plant.GetBodyByName("payload").body_frame(), plant.world_frame()
    acceleration = plant.CalcBiasSpatialAcceleration(
        context, JacobianWrtVariable.kV, body, np.zeros(3), world, world
    )
    force = acceleration.translational() - plant.gravity_field().gravity_vector()
    return body.CalcRotationMatrixInWorld(context).matrix().T @ force


def spin(*segments, robot=DEVICE, align="roll", more=()):
    resultant = Resultant(spin="planetary", align=align)
    tracks = [Track(resultant=resultant, segments=list(segments)), *more]
    return command_of(MotionProfile(duration=20, tracks=tracks), robot)


BACK = Ramp(at=12, to_g=1, duration=6)


@settings(max_examples=8)
@given(g=st.floats(1.02, 2), radius=st.floats(2.6, 4), sign=st.sampled_from([-1, 1]))
def test_spin_reaches_g_with_aligned_gondola_on_any_arm(g, radius, sign):
    def change(root):
        planetary, roll = (root.find(f".//joint[@name='{x}']") for x in ("planetary", "roll"))
        planetary.find(".//xyz").text, roll.find(".//xyz").text = f"0 0 {sign}", f"0 {sign} 0"
        roll.find(".//pose").text = f"{radius} 0 0.4 0 0 0"

    robot = edited(DEVICE, change)
    motion = sampled(spin(Ramp(to_g=g, acceleration_deg_s2=40), BACK, robot=robot))
    force = at_last_joint(robot, motion, 2000)
    assert np.linalg.norm(force) / 9.81 == pytest.approx(g, rel=1e-9)
    assert np.hypot(force[0], force[1]) / force[2] < 2e-6  # rad
    assert motion.q[2000, 1] == pytest.approx(-sign * np.arccos(1 / g), abs=2e-6)
    assert motion.q[-1, 1] == pytest.approx(0, abs=2e-6)


# --- what ships ------------------------------------------------------------------------------


def test_reference_motion_equals_published_one():
    command = load_command("reference", DEVICE)
    t = 0.005 * np.arange(6001)
    roll = [0, 1.5, 1.5, -1.5, -1.5, 1.5, 1.5, 0]
    pitch = 0.1 * (2 * np.pi / 5) * np.cos(2 * np.pi * t / 5)
    # Yaw: a square wave that flips every 2.5 s, with ramps of 0.5 s.
    times, speeds = [1.0], [0.0]
    for i in range(11):
        times += [max(1.5, 0.5 + 2.5 * i), 2.5 + 2.5 * i]
        speeds += [0.2093 * (-1) ** i] * 2
    expected = [
        np.interp(t, [0.5, 5.83333, 20, 25.33333], [0, 2.4, 2.4, 0]),
        np.interp(t, [2, 2.5, 9, 10, 16.7, 17.7, 26, 26.5], roll),
        pitch * np.clip(t / 2, 0, 1) * np.clip((29 - t) / 2, 0, 1),
        np.interp(t, [*times, 28], [*speeds, 0]),
    ]
    assert (command.name, command.duration, command.q0.tolist()) == ("reference", 30, [0] * 4)
    np.testing.assert_allclose(command.speeds(t).T, expected, atol=1e-12)


# --- bad profiles ----------------------------------------------------------------------------

YAW, END = "joint: yaw", "!Ramp {to_deg_s: 0, duration: 1}"
GO, DOWN = "!Ramp {to_deg_s: 5, duration: 1}", "!Ramp {at: 12, to_g: 1, duration: 6}"
UPRIGHT = "resultant: {spin: planetary, align: roll}"
BAD = [  # tracks, each a joint or resultant with its segments
    [
        ("resultant: null", END),
        ("joint: roll", "!Ramp {to_g: 1.5, duration: 4}"),
        (YAW, "!Ramp {to_deg_s: 5, duration: 4, acceleration_deg_s2: 1}",
         "!Knots {knots: [[0, 0]]}", "!Knots {knots: [[0, 0], [9, 1], [9, 2], [20, 0]]}",
         "!Knots {knots: [[0.1, 0], [20, 0]]}", "!Sampled {period: 1, speeds: [1]}",
         "!Fourier {period: 2, sine: [1, -0.5], cosine: [0, 1], end: 3}",
         "!Fourier {period: 2, sine: [1, 0.5], cosine: [0, 1], end: 4}",
         "!Fourier {period: 2, sine: [1, -0.5], cosine: [0], end: 4}",
         "!Oscillation {amplitude: 1, period: 1e-9, fade: 1, end: 2}",
         "!Spline {points: [[0, 0], [2, 9], [1, 3]]}", "!Spline {points: [[1, 0], [2, 9]]}"),
        (UPRIGHT, END, "!Turn {by_deg: 15, duration: 4}",
         "!Ramp {to_g: 2, duration: 4, blend: linear}"),
    ],
    [("resultant: {spin: yaw}", DOWN), ("resultant: {spin: roll}", DOWN)],
    [("joint: rol", END)],
    [("resultant: {spin: planetary, align: bank}", DOWN)],
    [(YAW, END), ("resultant: {spin: yaw}", DOWN)],
    [("resultant: {spin: pitch}", DOWN)],
    [("resultant: {spin: yaw, align: roll}", DOWN)],
    [("resultant: {spin: planetary, align: pitch}", DOWN)],
    [("joint: roll", END), ("resultant: {spin: planetary, align: yaw}", DOWN)],
    [(YAW, GO, "!Hold {at: 4, duration: 1}", "!Hold {at: 0.5, duration: 1}")],
    [(YAW, "!Ramp {to_deg_s: 0, acceleration_deg_s2: 5}")],
    [(YAW, "!Ramp {to_deg_s: -5, duration: 1}")],
    [(YAW, GO, "!Turn {by_deg: 5, duration: 1}")],
    [("resultant: {spin: planetary}", "!Ramp {to_g: 3, duration: 4}", DOWN)],
    [(YAW, "!Knots {knots: [[0, 0], [18, 1], [19, 0]]}")],
    [(YAW, "!Knots {knots: [[0, 0], [20.0000001, 0]]}")],
]  # fmt: skip
STILL, SHORT = "!Knots {knots: [[0, 0], [20, 0]]}", "!Knots {knots: [[0, 0], [18, 0]]}"


def test_each_profile_problem_is_a_line_with_its_place(tmp_path, file_regression):
    """The largest G is hypot(1, 3.1167² 2.6 / 9.81)."""
    path, lines, texts = (
        tmp_path / "test.yaml",
        [],
        [f"joints: [{STILL}]", f"joints: [{STILL}, {SHORT}, {STILL}, {STILL}]"],
    )
    for tracks in BAD:
        parts = [f"{{{what}, segments: [{', '.join(segments)}]}}" for what, *segments in tracks]
        texts.append(f"tracks: [{', '.join(parts)}]")
    for text in [*texts, f"start_deg: [0, 0]\nq0: [0]\njoints: [{STILL}]\n{texts[-1]}"]:
        path.write_text(f"duration: 20\n{text}")
        with pytest.raises(InputError) as error:
            load_command(path, DEVICE)
        lines += str(error.value).splitlines()
        assert all(line.startswith(f"{path}: ") for line in lines)
    file_regression.check("\n".join(line.removeprefix(f"{path}: ") for line in lines))
