"""Motion profiles: closed forms of the segments, G and alignment, the library, bad profiles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import sampled
from pydrake.multibody.tree import JacobianWrtVariable
from strategies import profiles

from sdt_drake.io.errors import InputError
from sdt_drake.io.resources import models_dir
from sdt_drake.motion import MotionProfile, command_of, load_command, load_profile, shipped_motions
from sdt_drake.motion.profile import Resultant, Track
from sdt_drake.motion.segments import Fourier, Hold, Knots, Oscillation, Ramp, Sampled, Turn
from sdt_drake.robot.robot import edited, load_robot

DEVICE = load_robot()


def of_yaw(*segments, duration=20.0, robot=DEVICE, **fields):
    """The command of a profile in which joint 4 moves."""
    track = Track(joint="yaw", segments=list(segments))
    return command_of(MotionProfile(duration=duration, tracks=[track], **fields), robot)


# --- segments --------------------------------------------------------------------------------

_SWING = 0.1 * np.pi / 2  # largest speed of 0.1 rad in 4 s
_SPEEDS = {  # [rad/s] by time
    "knots": (
        [Knots(at=1, knots=[[0, 0], [1, 2], [3, -2], [10, 5]])],
        {0: 0, 1.5: 1, 2: 2, 2.5: 1, 3: 0, 4: -2, 7.5: 1.5, 11: 5},
    ),
    "samples": (
        [Sampled(at=1, period=2.5, speeds=[0, 1, -1, 0, 4])],
        {0: 0, 2.25: 0.5, 3.5: 1, 4.75: 0, 6: -1, 8.5: 0, 9.75: 2, 11: 4},
    ),
    "swing": (
        [Oscillation(at=1, amplitude=0.1, period=4, fade=1, end=9)],
        {0: 0, 1.5: _SWING * np.sqrt(0.5) / 2, 2: 0, 3: -_SWING, 5: _SWING, 9: _SWING,
         9.5: _SWING * np.sqrt(0.5) / 2, 10: 0, 11: 0},
    ),
    "linear ramps": (
        [Ramp(at=1, to_deg_s=10, duration=4, blend="linear"),
         Ramp(at=7, to_deg_s=-6, acceleration_deg_s2=8, blend="linear"),
         Ramp(at=10, to_deg_s=0, duration=1, blend="linear")],
        {t: np.radians(v) for t, v in {0: 0, 1: 0, 2: 2.5, 5: 10, 6: 10, 7: 10, 8: 2, 9: -6,
                                       9.5: -6, 10.5: -3, 11: 0}.items()},
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", _SPEEDS)
def test_speeds_are_those_computed_by_hand(kind):
    segments, expected = _SPEEDS[kind]
    v = of_yaw(*segments, duration=11.0).speeds(np.array(list(expected), dtype=float))
    np.testing.assert_allclose(v[:, 3], list(expected.values()), atol=1e-14)
    assert not v[:, :3].any()


def test_a_fourier_motion_is_its_sum():
    series = Fourier(at=1, period=4, sine=[0.3, -0.15], cosine=[0.1, 0.2], end=8)
    motion = sampled(of_yaw(Hold(duration=1), series), 1e-3)
    t = 2 * np.pi / 4 * np.array([0.7, 2.9, 6.1])
    expected = 0.3 * np.sin(t) - 0.15 * np.sin(2 * t) + 0.1 * (np.cos(t) - 1)
    expected += 0.2 * (np.cos(2 * t) - 1)
    assert motion.q[[1700, 3900, 7100], 3] == pytest.approx(expected, abs=1e-6)


@settings(max_examples=15)
@given(profile=profiles(DEVICE), angle=st.floats(-90, 90))
def test_a_turn_after_any_segments_ends_at_its_angle(profile, angle):
    for track in profile.tracks:
        track.segments.append(Turn(to_deg=angle, duration=2))
    profile.duration = 6
    motion = sampled(command_of(profile, DEVICE), 1e-3)
    for track in profile.tracks:
        end = motion.q[-1, DEVICE.joint_names.index(track.joint)]
        assert np.degrees(end) == pytest.approx(angle, abs=1e-3)
    np.testing.assert_allclose(np.degrees(motion.q[0]), profile.start_deg)


@given(
    speed=st.floats(5, 60), most=st.floats(10, 100), by=st.floats(10, 90),
    sign=st.sampled_from([-1, 1]), blend=st.sampled_from(["cosine", "linear"]),
)  # fmt: skip
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
    v = sign * np.degrees(command.speeds(turn + (end - turn) * t)[:, 3])
    assert -v.min() == pytest.approx(speed, rel=1e-3)
    assert v.mean() * (end - turn) == pytest.approx(-by, rel=1e-3)
    # A quarter of the way: (1 - cos(pi / 2)) / 2, or 3 / 4 of the first third.
    assert -v[1000] == pytest.approx(speed * {"cosine": 0.5, "linear": 0.75}[blend], rel=1e-3)


def test_speeds_turn_at_the_corners():
    swing = Oscillation(at=1, amplitude=1, period=1, fade=0.3, end=2)
    corners = of_yaw(swing, Turn(at=5, by_deg=3, duration=2)).corners()
    turns = np.array([0, 1, 1.3, 1.5, 2, 2.5, 2.7, 3, 5, 6, 7, 20])
    np.testing.assert_allclose(np.abs(corners[:, None] - turns).min(axis=0), 0, atol=1e-12)


def test_joints_are_one_segment_for_each_base_to_tip():
    still = Knots(knots=[[0, 0], [2, 0]])
    joints = [Knots(knots=[[0, 0.5], [2, 2]]), Sampled(period=2, speeds=[1, 0]), still, still]
    command = command_of(MotionProfile(duration=2, joints=joints, q0=[1, 2, 3, 4]), DEVICE)
    np.testing.assert_array_equal(command.speeds(np.array([0, 1]))[:, :2], [[0.5, 1], [1.25, 0.5]])
    np.testing.assert_array_equal(command.q0, [1, 2, 3, 4])
    assert [segment.track for segment in command.timeline] == list(DEVICE.joint_names)


# --- a commanded G ---------------------------------------------------------------------------


def at_last_joint(robot, motion, i):
    """Specific force [N/kg] at the last joint in the axes of the payload, at constant speed."""
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, np.concatenate([motion.q[i], motion.v[i]]))
    body, world = plant.GetBodyByName("payload").body_frame(), plant.world_frame()
    acceleration = plant.CalcBiasSpatialAcceleration(
        context, JacobianWrtVariable.kV, body, np.zeros(3), world, world
    )
    force = acceleration.translational() - plant.gravity_field().gravity_vector()
    return body.CalcRotationMatrixInWorld(context).matrix().T @ force


def changed(**replacements):
    """The shipped device with other texts at places of its XML: path__tag=text."""

    def edit(root):
        for joint in root.iter("joint"):
            for key, text in replacements.items():
                name, tag = key.split("__")
                if joint.get("name") == name:
                    joint.find(f".//{tag}").text = text

    return edited(DEVICE, edit)


def spin(*segments, robot=DEVICE, align="roll", spin="planetary", more=(), **fields):
    tracks = [Track(resultant=Resultant(spin=spin, align=align), segments=list(segments)), *more]
    return command_of(MotionProfile(duration=20, tracks=tracks, **fields), robot)


UP, BACK = Ramp(to_g=1.5, duration=6), Ramp(at=12, to_g=1, duration=6)


@settings(max_examples=8)
@given(g=st.floats(1.02, 2), radius=st.floats(2.6, 4), sign=st.sampled_from([-1, 1]))
def test_the_commanded_g_is_reached_and_the_gondola_aligned_on_any_arm(g, radius, sign):
    robot = changed(
        roll__xyz=f"0 {sign} 0", roll__pose=f"{radius} 0 0.4 0 0 0", planetary__xyz=f"0 0 {sign}"
    )
    motion = sampled(spin(Ramp(to_g=g, acceleration_deg_s2=40), BACK, robot=robot))
    assert np.hypot(1, motion.v[2000, 0] ** 2 * radius / 9.81) == pytest.approx(g, rel=1e-9)
    force = at_last_joint(robot, motion, 2000)
    assert np.linalg.norm(force) / 9.81 == pytest.approx(g, rel=1e-9)
    assert np.hypot(force[0], force[1]) / force[2] < 2e-6  # rad
    assert motion.q[2000, 1] == pytest.approx(-sign * np.arccos(1 / g), abs=2e-6)
    assert motion.q[-1, 1] == pytest.approx(0, abs=2e-6)


def test_without_alignment_g_is_felt_sideways_and_linear_is_linear_in_spin_speed():
    ramp = Ramp(to_g=1.5, duration=6, blend="linear")
    motion = sampled(spin(ramp, BACK, align=None))
    assert not motion.q[:, 1:].any()
    assert motion.v[300, 0] == pytest.approx(motion.v[1200, 0] / 4, rel=1e-12)
    force = at_last_joint(DEVICE, motion, 1200)
    np.testing.assert_allclose(force, 9.81 * np.array([-np.sqrt(1.25), 0, 1]), atol=1e-8)


def test_a_track_of_the_aligned_joint_adds_to_the_alignment():
    turn = Track(joint="roll", segments=[Turn(at=4, to_deg=15, duration=4)])
    alone = command_of(MotionProfile(duration=20, tracks=[turn]), DEVICE)
    time = np.linspace(0, 20, 501)
    both, *each = (
        command.speeds(time)[:, 1]
        for command in (spin(UP, BACK, more=[turn]), spin(UP, BACK), alone)
    )
    np.testing.assert_allclose(both, sum(each), atol=1e-15)
    assert np.abs(each[1]).max() > 0.1


def test_a_joint_that_carries_the_aligned_one_must_stay():
    """With a second vertical axis on the arm: a spin about it is fine, unless the arm turns too."""
    two = changed(
        planetary__xyz="0 0 1", roll__xyz="0 0 1", pitch__pose="0 1.5 0 0 0 0", pitch__xyz="1 0 0"
    )
    how = {"robot": two, "spin": "roll", "align": "pitch"}
    segments = Ramp(to_g=1.2, duration=5), BACK
    assert spin(*segments, **how).alignment is not None
    turn = Track(joint="planetary", segments=[Turn(by_deg=5, duration=5)])
    for more in ({"more": [turn]}, {"start_deg": [5, 0, 0, 0]}):
        with pytest.raises(InputError, match="'planetary', which carries 'pitch'"):
            spin(*segments, **how, **more)


# --- what ships ------------------------------------------------------------------------------


def test_the_reference_motion_is_as_it_is_published():
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


def test_shipped_training_motions_have_a_title_a_feeling_and_their_assumptions():
    names = shipped_motions()
    assert len(names) == 8 and "reference" not in names
    for name in names:
        profile = load_profile(name)
        assert profile.name == name and profile.title and profile.feels.endswith(".")
        assert "assumed" in profile.notes and profile.duration <= 90
        assert "assumed" in (models_dir() / f"motions/{name}.yaml").read_text(encoding="utf-8")


def test_the_seat_of_somatogravic_faces_the_axis():
    """Resultant: 1.15 G, towards the back of the seat by acos(1 / 1.15)."""
    force = at_last_joint(DEVICE, sampled(load_command("somatogravic", DEVICE)), 4000) / 9.81
    # The link's y is the pilot's forward direction; the seat pushes forwards.
    np.testing.assert_allclose(force, [0, np.sqrt(1.15**2 - 1), 1], atol=1e-9)


def test_the_timeline_has_every_segment_with_its_times():
    spin, hold, back = load_command("graveyard_spiral", DEVICE).timeline
    assert spin[:3] == ("planetary + roll", 2, 12) and "1.5 G" in spin.text
    assert hold[:3] == ("planetary + roll", 12, 54)
    omega = np.degrees(np.sqrt(9.81 / 2.6 * np.sqrt(1.25)))
    assert back.end - back.start == pytest.approx(np.pi / 2 * omega / 10)


# --- bad profiles ----------------------------------------------------------------------------

YAW, SPIN = "joint: yaw", "resultant: {spin: planetary}"
ALIGNED = "resultant: {spin: planetary, align: roll}"
END, GO = "!Ramp {to_deg_s: 0, duration: 1}", "!Ramp {to_deg_s: 5, duration: 1}"
DOWN = "!Ramp {at: 12, to_g: 1, duration: 6}"
BAD = [  # tracks (the joint or resultant, and its segments), place and part of the message
    ([("joint: rol", END)], "tracks[1].joint: 'rol'"),
    ([("resultant: {spin: planetary, align: bank}", DOWN)], "resultant.align: 'bank'"),
    ([("joint:", END)], "tracks[1]: neither"),
    ([(YAW, END), ("joint: roll", END), (YAW, END)], "tracks[3]: joint 'yaw'"),
    ([("joint: planetary", END), (SPIN, DOWN)], "tracks[2]: joint 'planetary'"),
    ([(SPIN, DOWN), ("resultant: {spin: yaw}", DOWN)], "tracks[2].resultant: "),
    ([("resultant: {spin: pitch}", DOWN)], "resultant.spin: the axis of 'pitch'"),
    ([("resultant: {spin: yaw, align: roll}", DOWN)], "align: 'roll'"),
    ([("resultant: {spin: yaw}", DOWN)], "resultant.spin: 'yaw'"),
    ([("resultant: {spin: planetary, align: pitch}", DOWN)], "align: the axis of 'pitch'"),
    ([(YAW, "!Ramp {at: 1, to_deg_s: 5, duration: 4}", "!Hold {at: 3, duration: 1}")],
     "tracks[1].segments[2].at: 3 s, expected at least 5 s"),
    ([(YAW, "!Ramp {to_deg_s: 5, duration: 4, acceleration_deg_s2: 1}")],
     "segments[1]: duration and acceleration_deg_s2"),
    ([(YAW, "!Ramp {to_g: 1.5, duration: 4}")], "segments[1].to_g: "),
    ([(YAW, "!Ramp {to_deg_s: 0, acceleration_deg_s2: 5}")], "segments[1]: "),
    ([(YAW, "!Ramp {to_deg_s: -5, duration: 1}")], "[1]: 'yaw' ends at -5 deg/s"),
    ([(YAW, "!Turn {to_deg: 0, speed_deg_s: 5}")], "segments[1]: "),
    ([(YAW, GO, "!Turn {by_deg: 5, duration: 1}")], "segments[2]: !Turn starts at a speed of 5"),
    # hypot(1, 3.1167² 2.6 / 9.81)
    ([(SPIN, "!Ramp {to_g: 3, duration: 4}", DOWN)], "[1].to_g: 3 G, expected at most 2.762 G"),
    ([(SPIN, "!Ramp {to_deg_s: 15, duration: 4}")], "segments[1].to_deg_s: "),
    ([(SPIN, "!Turn {by_deg: 15, duration: 4}")], "segments[1]: !Turn"),
    ([(ALIGNED, "!Ramp {to_g: 2, duration: 4, blend: linear}", DOWN)], "segments[1].blend: "),
    ([(YAW, "!Knots {knots: [[0, 0]]}")], "segments[1].knots: "),
    ([(YAW, "!Knots {knots: [[0, 0], [9, 1], [9, 2], [20, 0]]}")], "knots: time 9 s"),
    ([(YAW, "!Knots {knots: [[0.1, 0], [20, 0]]}")], "segments[1].knots: start at 0.1 s"),
    ([(YAW, "!Knots {knots: [[0, 0], [19, 0]]}")], "segments[1]: ends at 19 s, expected exactly"),
    ([(YAW, "!Knots {knots: [[0, 0], [20.0000001, 0]]}")], "[1]: ends at 20.0000001 s"),
    ([(YAW, GO, "!Knots {knots: [[0, 0], [19, 0]]}")], "!Knots starts at a speed of 5 deg/s"),
    ([(YAW, "!Sampled {period: 1, speeds: [1]}")], "segments[1].speeds: 1 value(s)"),
    ([(YAW, "!Oscillation {amplitude: 1, period: 1, fade: 1, end: 21}")], "[1]: ends at 21 s"),
    ([(YAW, "!Fourier {period: 2, sine: [1, -0.5], cosine: [0, 1], end: 3}")], "end: 3 s"),
    ([(YAW, "!Fourier {period: 2, sine: [1, 0.5], cosine: [0, 1], end: 4}")], "sine: starts at"),
    ([(YAW, "!Fourier {period: 2, sine: [1, -0.5], cosine: [0], end: 4}")], "cosine: 1 value(s)"),
    ([(YAW, "!Oscillation {amplitude: 1, period: 1e-9, fade: 1, end: 2}")], "period: 1e-09 s"),
    ([(YAW, GO, "!Oscillation {amplitude: 1, period: 1, fade: 1, end: 2}")],
     "segments[2]: !Oscillation starts at a speed of 5 deg/s"),
]  # fmt: skip
HEADS = [
    ("tracks: []", "tracks: "),
    ("joints: [!Knots {knots: [[0, 0], [20, 0]]}]", "joints: 1 value(s), expected 4"),
    ("start_deg: [0, 0]", "start_deg: 2 value(s), expected 4"),
    ("q0: [0, 0, 0, .nan]", "q0[4]: nan"),
    ("start_deg: [0, 0, 0, 0]\nq0: [0, 0, 0, 0]", "q0: "),
]


def profile_text(*tracks, head=""):
    text = f"duration: 20\n{head}\n" + "tracks:\n" * bool(tracks)
    for what, *segments in tracks:
        text += f"  - {what}\n    segments:\n" + "".join(f"      - {s}\n" for s in segments)
    return text


BAD = [(profile_text(*tracks), message) for tracks, message in BAD]
BAD += [
    (profile_text(*([(YAW, END)] if "0:" in h or "deg" in h else []), head=h), m) for h, m in HEADS
]


@pytest.mark.parametrize("text, message", BAD, ids=[case[1] for case in BAD])
def test_a_bad_profile_is_one_line_with_file_and_place(tmp_path, text, message):
    path = tmp_path / "test.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        load_command(path, DEVICE)
    (line,) = str(error.value).splitlines()
    assert line.startswith(f"{path}: ") and message in line
