"""Training profiles: closed forms of the pieces, G and alignment, the library, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.tree import JacobianWrtVariable

from sdt_drake.errors import InputError
from sdt_drake.motion import (
    Command,
    CommandProfile,
    Motion,
    find_motion,
    load_command,
    load_training,
    plan_motion,
    shipped_motions,
)
from sdt_drake.resources import models_dir
from sdt_drake.robot import edited, load_robot

PERIOD = 0.005
SPIN = "resultant: {spin: planetary}"
ALIGNED = "resultant: {spin: planetary, align: roll}"
ROLL, YAW, PLANETARY = "joint: roll", "joint: yaw", "joint: planetary"


def profile_text(*tracks, duration=20, more=""):
    """YAML of a profile with `tracks`, each what moves and its segments."""
    text = f"name: test\nduration: {duration}\n{more}\ntracks:\n"
    for what, *segments in tracks:
        text += f"  - {what}\n    segments:\n" + "".join(f"      - {s}\n" for s in segments)
    return text


@pytest.fixture
def write(tmp_path):
    """Writes a profile, returns its path."""

    def write(*tracks, **options):
        path = tmp_path / "test.yaml"
        path.write_text(profile_text(*tracks, **options), encoding="utf-8")
        return path

    return write


@pytest.fixture
def command(write, robot):
    """The command of a profile with `tracks` for the shipped device."""

    def command(*tracks, **options) -> Command:
        return load_command(write(*tracks, **options), robot)

    return command


def degrees(command, k, times):
    """Speed of joint k [deg/s] at `times` [s]."""
    return np.degrees(command.speeds(np.array(times, dtype=float))[:, k])


def motion_of(command, period=PERIOD) -> Motion:
    time = np.arange(round(command.duration / period) + 1) * period
    return Motion.from_speeds(period, command.start(), command.speeds(time))


# --- pieces ----------------------------------------------------------------------------------


def test_a_linear_ramp_by_hand(command):
    ramp = command(
        (YAW, "!Ramp {at: 1, to_deg_s: 10, duration: 4, blend: linear}",
         "!Ramp {at: 7, to_deg_s: -6, acceleration_deg_s2: 8, blend: linear}",
         "!Ramp {at: 10, to_deg_s: 0, duration: 1, blend: linear}"),
    )  # fmt: skip
    expected = {0: 0, 1: 0, 2: 2.5, 4.5: 8.75, 5: 10, 6: 10, 7: 10, 8: 2, 9: -6, 9.5: -6,
                10.5: -3, 11: 0, 20: 0}  # fmt: skip
    np.testing.assert_allclose(
        degrees(ramp, 3, list(expected)), list(expected.values()), atol=1e-12
    )
    assert not ramp.speeds(np.linspace(0, 20, 99))[:, :3].any()


def test_a_cosine_ramp_by_hand(command):
    ramp = command(
        (YAW, "!Ramp {to_deg_s: 12, duration: 3}", "!Hold {duration: 1}",
         "{to_deg_s: 0, duration: 2}"),
    )  # fmt: skip
    # 12 (1 - cos(pi t / 3)) / 2, then down by half a cosine in 2 s.
    expected = {0: 0, 1: 3, 1.5: 6, 2: 9, 3: 12, 4: 12, 4.5: 6 * (1 + np.sqrt(0.5)), 5: 6, 6: 0}
    np.testing.assert_allclose(
        degrees(ramp, 3, list(expected)), list(expected.values()), atol=1e-12
    )
    # The mean speed of half a cosine is half its largest.
    time = np.linspace(0, 6, 60001)
    angle = np.trapezoid(degrees(ramp, 3, time), time)
    assert angle == pytest.approx(18 + 12 + 12, rel=1e-9)


@pytest.mark.parametrize("blend, factor", [("linear", 1), ("cosine", np.pi / 2)])
def test_an_acceleration_is_the_largest_one(command, blend, factor):
    ramp = command(
        (YAW, f"!Ramp {{to_deg_s: -30, acceleration_deg_s2: 15, blend: {blend}}}",
         "!Ramp {at: 10, to_deg_s: 0, duration: 5}"),
    )  # fmt: skip
    end = factor * 30 / 15
    before, after = degrees(ramp, 3, [end - 1e-3, end + 1e-3])
    assert after == pytest.approx(-30, abs=1e-12) and before > -30 + 1e-7
    time = np.linspace(0, 5, 50001)
    assert np.abs(np.diff(degrees(ramp, 3, time)) / 1e-4).max() == pytest.approx(15, rel=1e-4)


@pytest.mark.parametrize("blend, largest, at_quarter", [("cosine", 2, 0.5), ("linear", 1.5, 0.75)])
def test_turns_from_rest_to_rest(command, blend, largest, at_quarter):
    """30 deg in 6 s are 5 deg/s in the mean; then to -10 deg; speed given, it lasts as it must."""
    turn = command(
        (YAW, f"!Turn {{at: 1, by_deg: 30, duration: 6, blend: {blend}}}",
         f"!Turn {{to_deg: -10, speed_deg_s: 20, blend: {blend}}}"),
        more="start_deg: [0, 0, 0, 5]",
    )  # fmt: skip
    time = np.linspace(0, 20, 200001)
    speed = degrees(turn, 3, time)
    assert degrees(turn, 3, [2.5])[0] == pytest.approx(5 * largest * at_quarter, rel=1e-12)
    assert speed.max() == pytest.approx(5 * largest, rel=1e-6)
    assert speed.min() == pytest.approx(-20, rel=1e-6)
    assert np.ptp(time[speed < 0]) == pytest.approx(45 * largest / 20, abs=1e-3)
    angle = 5 + np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * 1e-4)])
    assert angle[70000] == pytest.approx(35, abs=1e-6)
    assert angle[-1] == pytest.approx(-10, abs=1e-6)
    assert np.degrees(turn.start()[3]) == pytest.approx(5)


@pytest.mark.parametrize(
    "segment", ["!Ramp {to_deg_s: 60, duration: 1}", "!Turn {by_deg: 40, duration: 2}"]
)
def test_cosines_have_no_jump_in_acceleration(command, segment):
    """Jerk: 60 deg/s pi² / 2 / (1 s)², or 40 deg/s pi² / 2 / (1 s)²; a jump would make it grow."""
    moved = command((YAW, segment, "!Ramp {at: 10, to_deg_s: 0, duration: 4}"))
    jerks = [
        np.abs(np.diff(degrees(moved, 3, np.arange(0, 5, dt)), n=2)).max() / dt**2
        for dt in (1e-3, 1e-4)
    ]
    largest = (60 if "Ramp" in segment else 40) * np.pi**2 / 2
    assert jerks == pytest.approx([largest, largest], rel=0.01)


# --- a wanted G --------------------------------------------------------------------------------


def at_last_joint(robot, q, v):
    """Specific force (N kg^-1) at the last joint in the axes of the payload, at constant speed."""
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)
    body = plant.GetBodyByName("payload").body_frame()
    acceleration = plant.CalcBiasSpatialAcceleration(
        context, JacobianWrtVariable.kV, body, np.zeros((3, 1)), plant.world_frame(),
        plant.world_frame(),
    )  # fmt: skip
    if isinstance(acceleration, list):
        acceleration = acceleration[0]
    force = acceleration.translational() - plant.gravity_field().gravity_vector()
    return body.CalcRotationMatrixInWorld(context).matrix().T @ force


@pytest.mark.parametrize("g", [1.05, 1.5, 2.0, 2.5])
@pytest.mark.parametrize("how", ["duration: 6", "acceleration_deg_s2: 40"])
def test_the_wanted_g_is_reached_and_the_gondola_aligned(command, robot, g, how):
    wanted = command(
        (ALIGNED, f"!Ramp {{to_g: {g}, {how}}}", "!Ramp {at: 12, to_g: 1, duration: 8}")
    )
    omega = wanted.speeds(np.array([10.0]))[0, 0]
    # R = 2.6 m, g = 9.81 m/s²
    assert np.hypot(1, omega**2 * 2.6 / 9.81) == pytest.approx(g, rel=1e-9)
    motion = motion_of(wanted)
    force = at_last_joint(robot, motion.q[2000], motion.v[2000])
    assert np.linalg.norm(force) / 9.81 == pytest.approx(g, rel=1e-9)
    assert np.hypot(force[0], force[1]) / force[2] < 1e-6  # rad
    assert motion.q[2000, 1] == pytest.approx(-np.arccos(1 / g), abs=1e-6)
    assert motion.q[-1, 1] == pytest.approx(0, abs=2e-6)
    assert not motion.v[-1].any()


def test_alignment_follows_the_spin_all_the_way(command):
    """theta = -atan(omega² R / g) at every instant, not just at the end."""
    wanted = command((ALIGNED, "!Ramp {to_g: 1.8, duration: 8}", "!Ramp {to_g: 1, duration: 8}"))
    time = np.arange(0, 20, 1e-3)
    v = wanted.speeds(time)
    theta = np.concatenate([[0], np.cumsum((v[1:, 1] + v[:-1, 1]) / 2 * 1e-3)])
    np.testing.assert_allclose(theta, -np.arctan(v[:, 0] ** 2 * 2.6 / 9.81), atol=1e-7)


def test_without_alignment_the_others_stay(command, robot):
    wanted = command((SPIN, "!Ramp {to_g: 1.5, duration: 6}", "!Ramp {to_g: 1, duration: 6}"))
    motion = motion_of(wanted)
    assert not motion.v[:, 1:].any()
    force = at_last_joint(robot, motion.q[1200], motion.v[1200])
    np.testing.assert_allclose(force, 9.81 * np.array([-np.sqrt(1.25), 0, 1]), atol=1e-8)


def test_linear_goes_linearly_in_spin_speed(command):
    wanted = command(
        (SPIN, "!Ramp {to_g: 1.5, duration: 6, blend: linear}", "!Ramp {to_g: 1, duration: 6}")
    )
    slow, fast = wanted.speeds(np.array([1.5, 6.0]))[:, 0]
    assert slow == pytest.approx(fast / 4, rel=1e-12)


def test_a_track_of_the_aligned_joint_adds_to_the_alignment(command):
    spin = (ALIGNED, "!Ramp {to_g: 1.5, duration: 6}", "!Ramp {at: 12, to_g: 1, duration: 6}")
    turn = (ROLL, "!Turn {at: 4, to_deg: 15, duration: 4}", "!Turn {to_deg: 0, duration: 4}")
    time = np.linspace(0, 20, 501)
    both, *each = (
        command(*tracks).speeds(time)[:, 1] for tracks in ((spin, turn), (spin,), (turn,))
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


def test_sign_and_radius_come_from_the_robot(write):
    """Roll axis the other way round: +atan; arm of 3.25 m: slower by sqrt(2.6 / 3.25)."""
    path = write((ALIGNED, "!Ramp {to_g: 1.5, duration: 6}", "!Ramp {to_g: 1, duration: 6}"))
    robot = changed(roll__xyz="0 -1 0", roll__pose="3.25 0 0.4 0 0 0", planetary__xyz="0 0 -1")
    motion = motion_of(load_command(path, robot))
    assert motion.q[1200, 1] == pytest.approx(np.arccos(1 / 1.5), abs=1e-6)
    omega = np.sqrt(9.81 / 3.25 * np.sqrt(1.25))
    assert motion.v[1200, 0] == pytest.approx(omega, rel=1e-12)
    force = at_last_joint(robot, motion.q[1200], motion.v[1200])
    assert np.hypot(force[0], force[1]) / force[2] < 1e-6


@pytest.mark.parametrize(
    "change, parts",
    [
        ({"planetary__xyz": "0 0.1 1"}, ["resultant.spin", "'planetary' is not vertical"]),
        ({"roll__xyz": "1 0 0"}, ["resultant.align", "'roll' is not along the path"]),
        ({"roll__pose": "0 0 1 0 0 0"}, ["resultant.align", "does not carry 'roll' around"]),
    ],
)
def test_robots_that_cannot_make_or_align_g_are_refused(write, change, parts):
    path = write((ALIGNED, "!Ramp {to_g: 1.5, duration: 6}", "!Ramp {to_g: 1, duration: 6}"))
    with pytest.raises(InputError) as error:
        load_command(path, changed(**change))
    for part in (str(path), "tracks[1].resultant", *parts):
        assert part in str(error.value)


# --- what is refused ---------------------------------------------------------------------------

END = "!Ramp {to_deg_s: 0, duration: 1}"
BACK = "!Ramp {to_g: 1, duration: 4}"
BAD = {
    "joint that does not exist": (
        [("joint: rol", END)], ["tracks[1].joint: 'rol'", "planetary, roll, pitch, yaw"],
    ),
    "spin that does not exist": (
        [("resultant: {spin: arm}", BACK)], ["tracks[1].resultant.spin: 'arm'", "planetary, roll"],
    ),
    "align that does not exist": (
        [("resultant: {spin: planetary, align: bank}", BACK)], ["resultant.align: 'bank'"],
    ),
    "neither joint nor resultant": ([("joint:", END)], ["tracks[1]: expected either joint or"]),
    "no segments": ([(ROLL,)], ["tracks[1].segments"]),
    "overlap": (
        [(YAW, "!Ramp {at: 1, to_deg_s: 5, duration: 4}", "!Hold {at: 3, duration: 1}")],
        ["tracks[1].segments[2].at: overlap", "3 s", "5 s"],
    ),
    "negative start": ([(YAW, "!Hold {at: -1, duration: 1}")], ["segments[1].at: -1", ">= 0"]),
    "negative duration": (
        [(YAW, "!Ramp {to_deg_s: 5, duration: -4}")], ["tracks[1].segments[1].duration: -4", "> 0"],
    ),
    "duration of zero": ([(YAW, "!Hold {duration: 0}")], ["segments[1].duration: 0", "> 0"]),
    "duration that is not a number": (
        [(YAW, "!Hold {duration: .nan}")], ["segments[1].duration: nan"],
    ),
    "infinite duration": ([(YAW, "!Hold {duration: .inf}")], ["segments[1].duration: inf"]),
    "hold without duration": ([(YAW, "!Hold {at: 1}")], ["segments[1].duration: missing"]),
    "duration and acceleration": (
        [(YAW, "!Ramp {to_deg_s: 5, duration: 4, acceleration_deg_s2: 1}")],
        ["segments[1]: duration and acceleration_deg_s2, expected duration or"],
    ),
    "neither duration nor acceleration": (
        [(YAW, "!Ramp {to_deg_s: 5}")], ["segments[1]: neither, expected duration or"],
    ),
    "negative acceleration": (
        [(YAW, "!Ramp {to_deg_s: 5, acceleration_deg_s2: -3}")],
        ["segments[1].acceleration_deg_s2: -3", "> 0"],
    ),
    "speed that is not a number": (
        [(YAW, "!Ramp {to_deg_s: .nan, duration: 1}")], ["segments[1].to_deg_s: nan"],
    ),
    "unknown blend": (
        [(YAW, "!Ramp {to_deg_s: 5, duration: 1, blend: cubic}")],
        ["segments[1].blend: 'cubic'", "cosine, linear"],
    ),
    "unknown kind": ([(YAW, "!Jump {to_deg_s: 5}")], ["segments[1]: unknown kind !Jump", "!Ramp"]),
    "unknown field": ([(YAW, "!Ramp {to_deg: 5}")], ["segments[1].to_deg", "to_deg_s"]),
    "ramp to nothing": ([(YAW, "!Ramp {duration: 5}")], ["segments[1].to_deg_s: missing"]),
    "no change": (
        [(YAW, "!Ramp {to_deg_s: 0, acceleration_deg_s2: 5}")], ["segments[1]: nothing changes"],
    ),
    "turn to where it is": (
        [(YAW, "!Turn {to_deg: 0, speed_deg_s: 5}")], ["segments[1]: nothing changes"],
    ),
    "turn by and to": (
        [(YAW, "!Turn {by_deg: 3, to_deg: 4, duration: 5}")], ["expected either by_deg or to_deg"],
    ),
    "turn by nothing": ([(YAW, "!Turn {duration: 5}")], ["expected either by_deg or to_deg"]),
    "turn by infinity": (
        [(YAW, "!Turn {by_deg: .inf, duration: 5}")], ["segments[1].by_deg: inf"],
    ),
    "turn with negative speed": (
        [(YAW, "!Turn {by_deg: 5, speed_deg_s: -5}")], ["segments[1].speed_deg_s: -5", "> 0"],
    ),
    "turn in motion": (
        [(YAW, "!Ramp {to_deg_s: 5, duration: 1}", "!Turn {by_deg: 5, duration: 1}")],
        ["segments[2]: !Turn at a speed of 5 deg/s", "expected rest"],
    ),
    "G below 1": ([(SPIN, "!Ramp {to_g: 0.9, duration: 4}")], ["segments[1].to_g: 0.9", ">= 1"]),
    "G beyond the speed limit": (
        # hypot(1, 3.1167² 2.6 / 9.81)
        [(SPIN, "!Ramp {to_g: 3, duration: 4}", BACK)], ["to_g: 3 G", "2.762 G", "'planetary'"],
    ),
    "G of a joint": ([(YAW, "!Ramp {to_g: 1.5, duration: 4}")], ["to_g: in a track of a joint"]),
    "joint speed of the resultant": (
        [(SPIN, "!Ramp {to_deg_s: 15, duration: 4}")], ["to_deg_s: in a track of the resultant"],
    ),
    "turn of the resultant": ([(SPIN, "!Turn {by_deg: 15, duration: 4}")], ["!Turn in a track of"]),
    "linear blend of an aligned resultant": (
        [(ALIGNED, "!Ramp {to_g: 2, duration: 4, blend: linear}", BACK)],
        ["segments[1].blend: 'linear'", "'roll' would have to jump"],
    ),
    "spin about an axis that is not vertical": (
        [("resultant: {spin: pitch}", BACK)], ["resultant.spin", "'pitch' is not vertical"],
    ),
    "align below the spin": (
        [("resultant: {spin: yaw, align: roll}", BACK)],
        ["resultant.align", "'yaw' does not carry 'roll'"],
    ),
    "spin on the spot": (
        [("resultant: {spin: yaw}", BACK)], ["resultant.spin", "does not carry"],
    ),
    "two tracks for one joint": (
        [(YAW, END), (ROLL, END), (YAW, END)], ["tracks[3]: joint 'yaw' is moved by tracks[1]"],
    ),
    "spin joint with a track of its own": (
        [(PLANETARY, "!Turn {by_deg: 5, duration: 5}"), (SPIN, BACK)],
        ["tracks[2]: joint 'planetary' is moved by tracks[1]"],
    ),
    "two resultants": ([(SPIN, BACK), (ALIGNED, BACK)], ["tracks[2].resultant: tracks[1] has one"]),
    "joint below the aligned one": (
        [("resultant: {spin: planetary, align: pitch}", BACK)], ["resultant.align", "'pitch'"],
    ),
    "segment after the end": (
        [(YAW, "!Hold {at: 18, duration: 3}")], ["segments[1]: ends at 21 s", "duration 20 s"],
    ),
    "speed at the end": (
        [(YAW, "!Ramp {to_deg_s: 5, duration: 4}")],
        ["tracks[1]: 'yaw' ends at 5 deg/s", "expected rest"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", BAD)
def test_bad_profiles_are_refused(command, tmp_path, fault):
    tracks, parts = BAD[fault]
    with pytest.raises(InputError) as error:
        load = command(*tracks)
        raise AssertionError(f"accepted: {load}")
    message = str(error.value)
    assert message.startswith(str(tmp_path / "test.yaml")) and "\n" not in message
    for part in parts:
        assert part in message, message


@pytest.mark.parametrize(
    "options, parts",
    [
        ({"duration": -1}, ["duration: -1", "> 0"]),
        ({"duration": ".nan"}, ["duration: nan"]),
        ({"more": "start_deg: [0, 0]"}, ["start_deg: 2 value(s), expected 4"]),
        ({"more": "speed: 3"}, ["speed: no such field"]),
    ],
)
def test_bad_heads_are_refused(command, options, parts):
    with pytest.raises(InputError) as error:
        command((YAW, "!Turn {by_deg: 5, duration: 1}"), **options)
    for part in parts:
        assert part in str(error.value)


def test_a_profile_without_tracks_is_refused(tmp_path, robot):
    path = tmp_path / "empty.yaml"
    path.write_text("duration: 3\ntracks: []\n")
    with pytest.raises(InputError, match=r"empty\.yaml: tracks: empty"):
        load_command(path, robot)


def test_what_carries_the_aligned_joint_must_stay(write, robot):
    """With a second vertical axis on the arm: a spin about it is fine, unless the arm turns too."""
    carried = "resultant: {spin: roll, align: pitch}"
    edited = changed(
        planetary__xyz="0 0 1", roll__xyz="0 0 1", pitch__pose="0 1.5 0 0 0 0", pitch__xyz="1 0 0"
    )
    spin = (carried, "!Ramp {to_g: 1.2, duration: 5}", BACK)
    assert load_command(write(spin), edited).alignment is not None
    for tracks, more in (
        ([spin, (PLANETARY, "!Turn {by_deg: 5, duration: 5}")], ""),
        ([spin], "start_deg: [5, 0, 0, 0]"),
    ):
        with pytest.raises(InputError, match="'planetary', which carries 'pitch', moves or starts"):
            load_command(write(*tracks, more=more), edited)


# --- names and files ----------------------------------------------------------------------------


def test_a_name_means_a_shipped_motion():
    assert find_motion("leans") == "package://sdt/motions/leans.yaml"
    assert find_motion("reference") == "package://sdt/motions/reference.yaml"
    for path in ("", "my.yaml", "folder/leans", "motion.csv", "package://sdt/motions/leans.yaml"):
        assert find_motion(path) == path
    with pytest.raises(InputError, match="graveyard_spn: no such motion, did you mean graveyard_"):
        find_motion("graveyard_spn")
    with pytest.raises(InputError, match=r"zzz: no such motion, shipped: coriolis, .*somatogravic"):
        find_motion("zzz")


def test_load_command_takes_both_kinds_of_profile(robot):
    assert isinstance(load_command("reference", robot), CommandProfile)
    assert isinstance(load_command("leans", robot), Command)


def test_a_profile_without_a_name_has_that_of_its_file(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(profile_text((YAW, END)).replace("name: test\n", ""))
    assert load_training(path).name == "mine"


# --- the library --------------------------------------------------------------------------------

LIBRARY = (
    "coriolis", "g_excess", "graveyard_spin", "graveyard_spiral", "inversion", "leans",
    "post_roll", "somatogravic",
)  # fmt: skip


def test_the_library_is_shipped():
    assert shipped_motions() == list(LIBRARY)
    for name in LIBRARY:
        profile = load_training(name)
        assert profile.name == name and profile.title and profile.feels.endswith(".")
        assert "assumed" in profile.notes and profile.duration <= 90
        assert "assumed" in (models_dir() / f"motions/{name}.yaml").read_text(encoding="utf-8")


@pytest.fixture(scope="module", params=LIBRARY)
def plan(request, robot):
    """A motion of the library, planned."""
    return plan_motion(robot, load_command(request.param, robot))


def test_every_motion_of_the_library_is_done_with_motors_to_spare(plan, robot):
    assert not plan.limited.any()
    assert plan.peak_use(robot).max() <= 0.9
    assert np.abs(plan.motion.v).max() > 0.1
    assert not plan.motion.v[0].any() and not plan.motion.v[-1].any()
    # The gondola ends upright, turned as it was, but for whole turns; the yaw joint anywhere.
    change = plan.motion.q[-1, 1:3] - plan.motion.q[0, 1:3]
    np.testing.assert_allclose(np.sin(change / 2), 0, atol=2e-6)


def test_leans_stay_below_mulders_threshold_until_the_correction(robot):
    command = load_command("leans", robot)
    time = np.arange(0, 65, 0.01)
    speed = degrees(command, 1, time)
    assert speed[time < 35].max() < 2.5
    assert np.abs(np.diff(speed[time < 35]) / 0.01).max() < 0.2501
    assert speed.min() < -10


def test_the_seat_of_somatogravic_faces_the_axis(robot):
    """Resultant: 1.15 G, towards the back of the seat by acos(1 / 1.15)."""
    motion = motion_of(load_command("somatogravic", robot))
    at = np.searchsorted(motion.time, 20.0)
    force = at_last_joint(robot, motion.q[at], motion.v[at]) / 9.81
    # The link's y is the pilot's forward direction; the seat pushes forwards.
    np.testing.assert_allclose(force, [0, np.sqrt(1.15**2 - 1), 1], atol=1e-9)


def test_spin_of_coriolis_is_earth_fixed_and_outside_of_the_tilt(robot):
    """In the head, the tilt turns the spin by 40 deg: |change| = 2 W sin(20 deg) = 41 deg/s."""
    motion = motion_of(load_command("coriolis", robot))
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    spins = []
    for time in (32.0, 40.0):
        at = np.searchsorted(motion.time, time)
        plant.SetPositions(context, motion.q[at])
        plant.SetVelocities(context, motion.v[at])
        head = plant.GetFrameByName("head")
        velocity = head.CalcSpatialVelocity(context, plant.world_frame(), head)
        spins.append(np.degrees(velocity.rotational()))
    assert np.linalg.norm(spins[1] - spins[0]) == pytest.approx(41.04, abs=0.01)


def test_post_roll_is_two_turns(robot):
    motion = motion_of(load_command("post_roll", robot))
    assert np.degrees(motion.q[-1, 1]) == pytest.approx(720, abs=1e-6)


def test_timeline_has_every_segment_with_its_times(robot):
    spin, hold, back = load_training("graveyard_spiral").timeline(robot)
    assert (spin.track, spin.start, spin.end, spin.text) == (
        "planetary + roll", 2, 12, "to 1.5 G, cosine",
    )  # fmt: skip
    assert (hold.start, hold.end, hold.text) == (12, 54, "hold")
    omega = np.degrees(np.sqrt(9.81 / 2.6 * np.sqrt(1.25)))
    assert back.end - back.start == pytest.approx(np.pi / 2 * omega / 10)
