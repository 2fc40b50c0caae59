"""Motion profiles: closed forms of the segments, G and alignment, the library."""

from __future__ import annotations

import numpy as np
import pytest
from motions import ALIGNED, BACK, PLANETARY, ROLL, SPIN, YAW, profile_text, sampled
from pydrake.multibody.tree import JacobianWrtVariable

from sdt_drake.io.errors import InputError
from sdt_drake.io.resources import models_dir
from sdt_drake.motion import MotionProfile, command_of, load_command, load_profile, shipped_motions
from sdt_drake.motion.profile import Track
from sdt_drake.motion.segments import Fourier, Hold, Knots, Oscillation, Ramp, Sampled, Turn
from sdt_drake.robot.robot import edited, load_robot


def of_yaw(robot, *segments, duration=20.0, **fields):
    """The command of a profile in which joint 4 moves."""
    track = Track(joint="yaw", segments=list(segments))
    return command_of(MotionProfile(duration=duration, tracks=[track], **fields), robot)


def degrees(command, k, times):
    """Speed of joint k [deg/s] at `times` [s]."""
    return np.degrees(command.speeds(np.array(times, dtype=float))[:, k])


# --- segments --------------------------------------------------------------------------------

_SWING = 0.1 * np.pi / 2  # largest speed of 0.1 rad in 4 s
_SPEEDS = {  # [rad/s] by time, from 1 s on
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
    # 12 (1 - cos(pi t / 3)) / 2, then down by half a cosine in 2 s
    "cosine ramps": (
        [Ramp(to_deg_s=12, duration=3), Hold(duration=1), Ramp(to_deg_s=0, duration=2)],
        {t: np.radians(v) for t, v in {0: 0, 1: 3, 1.5: 6, 2: 9, 3: 12, 4: 12,
                                       4.5: 6 * (1 + np.sqrt(0.5)), 5: 6, 6: 0}.items()},
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", _SPEEDS)
def test_speeds_are_those_computed_by_hand(robot, kind):
    segments, expected = _SPEEDS[kind]
    command = of_yaw(robot, *segments, duration=11.0)
    v = command.speeds(np.array(list(expected), dtype=float))
    np.testing.assert_allclose(v[:, 3], list(expected.values()), atol=1e-14)
    assert not v[:, :3].any()


def test_a_turn_to_an_angle_knows_how_far_ramps_have_turned(robot):
    ramps = Ramp(to_deg_s=12, duration=4), Ramp(to_deg_s=0, duration=2)  # by 36 deg
    turned = of_yaw(robot, *ramps, Turn(to_deg=0, duration=4), duration=10.0)
    speed = degrees(turned, 3, np.linspace(0, 10, 10001))
    assert np.sum(speed[:6001]) * 1e-3 == pytest.approx(36, abs=1e-3)
    assert np.sum(speed) * 1e-3 == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("blend, factor", [("linear", 1), ("cosine", np.pi / 2)])
def test_an_acceleration_is_the_largest_one_and_a_cosine_has_no_jump_in_it(robot, blend, factor):
    up = Ramp(to_deg_s=-30, acceleration_deg_s2=15, blend=blend)
    ramp = of_yaw(robot, up, Ramp(at=10, to_deg_s=0, duration=5))
    assert ramp.timeline[0].end == pytest.approx(factor * 30 / 15)
    speed = degrees(ramp, 3, np.linspace(0, 5, 50001))
    assert np.abs(np.diff(speed) / 1e-4).max() == pytest.approx(15, rel=1e-4)
    jerk = np.abs(np.diff(speed, n=2)).max() / 1e-8
    assert (jerk < 16) == (blend == "cosine")  # 15 deg/s² pi / duration = 15


@pytest.mark.parametrize("blend, largest, at_quarter", [("cosine", 2, 0.5), ("linear", 1.5, 0.75)])
def test_turns_from_rest_to_rest(robot, blend, largest, at_quarter):
    """30 deg in 6 s are 5 deg/s in the mean; then to -10 deg; speed given, it lasts as it must."""
    turn = of_yaw(
        robot,
        Turn(at=1, by_deg=30, duration=6, blend=blend),
        Turn(to_deg=-10, speed_deg_s=20, blend=blend),
        start_deg=[0, 0, 0, 5],
    )
    assert degrees(turn, 3, [2.5])[0] == pytest.approx(5 * largest * at_quarter, rel=1e-12)
    speed = degrees(turn, 3, np.linspace(0, 20, 20001))
    assert (speed.max(), speed.min()) == pytest.approx((5 * largest, -20), rel=1e-4)
    assert turn.timeline[1][1:3] == pytest.approx((7, 7 + 45 * largest / 20))
    angle = np.degrees(sampled(turn, 1e-3).q[:, 3])
    assert angle[[0, 7000, -1]] == pytest.approx([5, 35, -10], abs=1e-5)


def test_what_follows_a_swing_starts_from_the_angle_where_it_ends(robot):
    swing = Oscillation(at=1, amplitude=0.3, period=3.3, fade=1.3, end=5)
    command = of_yaw(robot, Hold(duration=1), swing, Turn(to_deg=20, duration=4))
    motion = sampled(command, 1e-3)
    assert abs(motion.q[6000, 3]) > 5e-3
    assert np.degrees(motion.q[-1, 3]) == pytest.approx(20, abs=1e-5)


def test_a_fourier_motion_is_its_sum_and_comes_back_to_rest(robot):
    series = Fourier(at=1, period=4, sine=[0.3, -0.15], cosine=[0.1, 0.2], end=8)
    command = of_yaw(robot, Hold(duration=1), series, Turn(to_deg=20, duration=4))
    motion = sampled(command, 1e-3)
    t = 2 * np.pi / 4 * np.array([0.7, 2.9, 6.1])
    expected = 0.3 * np.sin(t) - 0.15 * np.sin(2 * t) + 0.1 * (np.cos(t) - 1)
    expected += 0.2 * (np.cos(2 * t) - 1)
    assert motion.q[[1700, 3900, 7100], 3] == pytest.approx(expected, abs=1e-6)
    assert motion.v[[1000, 9000], 3] == pytest.approx([0, 0], abs=1e-9)
    assert np.degrees(motion.q[-1, 3]) == pytest.approx(20, abs=1e-5)


def test_speeds_turn_at_the_corners(robot):
    swing = Oscillation(at=1, amplitude=1, period=1, fade=0.3, end=2)
    corners = of_yaw(robot, swing, Turn(at=5, by_deg=3, duration=2)).corners()
    turns = np.array([0, 1, 1.3, 1.5, 2, 2.5, 2.7, 3, 5, 6, 7, 20])
    np.testing.assert_allclose(np.abs(corners[:, None] - turns).min(axis=0), 0, atol=1e-12)


def test_joints_are_one_segment_for_each_base_to_tip(robot):
    still = Knots(knots=[[0, 0], [2, 0]])
    joints = [Knots(knots=[[0, 0.5], [2, 2]]), Sampled(period=2, speeds=[1, 0]), still, still]
    command = command_of(MotionProfile(duration=2, joints=joints, q0=[1, 2, 3, 4]), robot)
    np.testing.assert_array_equal(command.speeds(np.array([0, 1]))[:, :2], [[0.5, 1], [1.25, 0.5]])
    np.testing.assert_array_equal(command.q0, [1, 2, 3, 4])
    assert [segment.track for segment in command.timeline] == list(robot.joint_names)


# --- a wanted G --------------------------------------------------------------------------------


def at_last_joint(robot, motion, i):
    """Specific force [N/kg] at the last joint in the axes of the payload, at constant speed."""
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, np.concatenate([motion.q[i], motion.v[i]]))
    body = plant.GetBodyByName("payload").body_frame()
    acceleration = plant.CalcBiasSpatialAcceleration(
        context, JacobianWrtVariable.kV, body, np.zeros(3), plant.world_frame(),
        plant.world_frame(),
    )  # fmt: skip
    force = acceleration.translational() - plant.gravity_field().gravity_vector()
    return body.CalcRotationMatrixInWorld(context).matrix().T @ force


UP = "!Ramp {to_g: 1.5, duration: 6}"


@pytest.mark.parametrize("g, how", [(1.05, "duration: 6"), (2.5, "acceleration_deg_s2: 40")])
def test_the_wanted_g_is_reached_and_the_gondola_aligned(loaded, robot, g, how):
    wanted = loaded((ALIGNED, f"!Ramp {{to_g: {g}, {how}}}", BACK))
    motion = sampled(wanted)
    # R = 2.6 m, g = 9.81 m/s²
    assert np.hypot(1, motion.v[2000, 0] ** 2 * 2.6 / 9.81) == pytest.approx(g, rel=1e-9)
    force = at_last_joint(robot, motion, 2000)
    assert np.linalg.norm(force) / 9.81 == pytest.approx(g, rel=1e-9)
    assert np.hypot(force[0], force[1]) / force[2] < 1e-6  # rad
    assert motion.q[2000, 1] == pytest.approx(-np.arccos(1 / g), abs=1e-6)
    assert motion.q[-1, 1] == pytest.approx(0, abs=2e-6)


def test_without_alignment_g_is_felt_sideways_and_linear_is_linear_in_spin_speed(loaded, robot):
    ramp = "!Ramp {to_g: 1.5, duration: 6, blend: linear}"
    motion = sampled(loaded((SPIN, ramp, BACK)))
    assert not motion.q[:, 1:].any()
    assert motion.v[300, 0] == pytest.approx(motion.v[1200, 0] / 4, rel=1e-12)
    force = at_last_joint(robot, motion, 1200)
    np.testing.assert_allclose(force, 9.81 * np.array([-np.sqrt(1.25), 0, 1]), atol=1e-8)


def test_a_track_of_the_aligned_joint_adds_to_the_alignment(loaded):
    spin = (ALIGNED, UP, BACK)
    turn = (ROLL, "!Turn {at: 4, to_deg: 15, duration: 4}", "!Turn {to_deg: 0, duration: 4}")
    time = np.linspace(0, 20, 501)
    both, *each = (
        loaded(*tracks).speeds(time)[:, 1] for tracks in ((spin, turn), (spin,), (turn,))
    )
    np.testing.assert_allclose(both, sum(each), atol=1e-15)
    assert np.abs(each[1]).max() > 0.1


def changed(**replacements):
    """The shipped device with other texts at places of its XML: path__tag=text."""

    def edit(root):
        for joint in root.iter("joint"):
            for key, text in replacements.items():
                name, tag = key.split("__")
                if joint.get("name") == name:
                    joint.find(f".//{tag}").text = text

    return edited(load_robot(), edit)


def test_sign_and_radius_come_from_the_robot(loaded):
    """Roll axis the other way round: +atan; arm of 3.25 m: slower by sqrt(2.6 / 3.25)."""
    other = changed(roll__xyz="0 -1 0", roll__pose="3.25 0 0.4 0 0 0", planetary__xyz="0 0 -1")
    motion = sampled(loaded((ALIGNED, UP, BACK), robot=other))
    assert motion.q[1200, 1] == pytest.approx(np.arccos(1 / 1.5), abs=1e-6)
    omega = np.sqrt(9.81 / 3.25 * np.sqrt(1.25))
    assert motion.v[1200, 0] == pytest.approx(omega, rel=1e-12)
    force = at_last_joint(other, motion, 1200)
    assert np.hypot(force[0], force[1]) / force[2] < 1e-6


@pytest.mark.parametrize(
    "change, message",
    [
        ({"planetary__xyz": "0 0.1 1"}, "resultant.spin: the axis of 'planetary' is not vertical"),
        ({"roll__xyz": "1 0 0"}, "resultant.align: the axis of 'roll' is not along the path"),
        ({"roll__pose": "0 0 1 0 0 0"}, "resultant.align: 'roll' is not on an arm of 'planetary'"),
    ],
)
def test_robots_that_cannot_make_or_align_g_are_refused(loaded, change, message):
    with pytest.raises(InputError, match=rf"test.yaml: tracks\[1\]\.{message}"):
        loaded((ALIGNED, UP, BACK), robot=changed(**change))


def test_what_carries_the_aligned_joint_must_stay(loaded):
    """With a second vertical axis on the arm: a spin about it is fine, unless the arm turns too."""
    two = changed(
        planetary__xyz="0 0 1", roll__xyz="0 0 1", pitch__pose="0 1.5 0 0 0 0", pitch__xyz="1 0 0"
    )
    spin = ("resultant: {spin: roll, align: pitch}", "!Ramp {to_g: 1.2, duration: 5}", BACK)
    assert loaded(spin, robot=two).alignment is not None
    for tracks, more in (
        ([spin, (PLANETARY, "!Turn {by_deg: 5, duration: 5}")], ""),
        ([spin], "start_deg: [5, 0, 0, 0]"),
    ):
        with pytest.raises(InputError, match="'planetary', which carries 'pitch', moves or starts"):
            loaded(*tracks, more=more, robot=two)


# --- names and files ----------------------------------------------------------------------------


def test_a_profile_without_a_name_has_that_of_its_file(tmp_path):
    (tmp_path / "mine.yaml").write_text(
        profile_text((YAW, "!Hold {duration: 1}")).replace("name: test\n", "")
    )
    assert load_profile(tmp_path / "mine.yaml").name == "mine"


# --- what ships ---------------------------------------------------------------------------------


def test_the_reference_motion_is_as_it_is_published(robot):
    command = load_command("reference", robot)
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


LIBRARY = (
    "coriolis", "g_excess", "graveyard_spin", "graveyard_spiral", "inversion", "leans",
    "post_roll", "somatogravic",
)  # fmt: skip


def test_the_library_is_shipped():
    assert shipped_motions() == list(LIBRARY)
    for name in LIBRARY:
        profile = load_profile(name)
        assert profile.name == name and profile.title and profile.feels.endswith(".")
        assert "assumed" in profile.notes and profile.duration <= 90
        assert "assumed" in (models_dir() / f"motions/{name}.yaml").read_text(encoding="utf-8")


def test_the_seat_of_somatogravic_faces_the_axis(robot):
    """Resultant: 1.15 G, towards the back of the seat by acos(1 / 1.15)."""
    force = at_last_joint(robot, sampled(load_command("somatogravic", robot)), 4000) / 9.81
    # The link's y is the pilot's forward direction; the seat pushes forwards.
    np.testing.assert_allclose(force, [0, np.sqrt(1.15**2 - 1), 1], atol=1e-9)


def test_the_timeline_has_every_segment_with_its_times(robot):
    spin, hold, back = load_command("graveyard_spiral", robot).timeline
    assert spin == ("planetary + roll", 2, 12, "to 1.5 G, cosine")
    assert hold == ("planetary + roll", 12, 54, "hold")
    omega = np.degrees(np.sqrt(9.81 / 2.6 * np.sqrt(1.25)))
    assert back.end - back.start == pytest.approx(np.pi / 2 * omega / 10)
