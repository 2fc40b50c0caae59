"""Stops at every instant of a motion: their figures by hand, the worst of them, and limits."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.motions import falling
from helpers.robots import RATE_TABLE, WRIST, chain_sdf, loaded

import sdt_drake as sdt
from sdt_drake.analysis.stop_setting import make_setting
from sdt_drake.analysis.stopping import Stopping, load_stopping
from sdt_drake.analysis.stops import Along, stoppable, stops, stops_along
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.pilot.head import GRAVITY, head_motion_of_samples
from sdt_drake.robot.brakes import Brakes
from sdt_drake.robot.device import Friction, friction_parameters
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.robot.motors import DeviceChoice, load_catalogue
from sdt_drake.show.figures.stops import course_panels
from sdt_drake.show.reports.stops import stop_findings

SDT = sdt.load_robot()
J = SDT.mass_matrix(SDT.context_at_zero())[0, 0]  # kg m², of the arm
W = 1.5  # rad/s, of the arm
STOP = load_stopping("stops", 4).changed({"every": 0.2, "limits": {}})


def turning(w=W, roll=0.0, duration=0.05):
    """The arm at a constant speed, and the roll axis, too."""
    count = round(duration / 0.005) + 1
    return Motion.from_speeds(0.005, np.zeros(4), np.tile([w, roll, 0.0, 0.0], (count, 1)))


def found(motion, changes=None, **fields):
    scenario = sdt.load("coupled_pi", fields)
    return stops(sdt.design(scenario, motion=motion), STOP.changed(changes or {}))


def worst(result, figure, joint=None):
    (one,) = (x for x in result.worst if (x.figure, x.joint) == (figure, joint))
    return one


def setting_of(delay, dynamic=7e3, energy=np.inf, **changes):
    """The device, with brakes on its inner joints that hold at once, and one on its arm."""
    brakes = Brakes(
        static=np.full(4, 1e6),
        dynamic=np.array([dynamic, 1e6, 1e6, 1e6]),
        delay=np.array([delay, 0, 0, 0]),
        inertia=np.zeros(4),
        energy=np.array([energy, np.inf, np.inf, np.inf]),
    )
    return dataclasses.replace(
        make_setting(SDT, STOP.changed(changes), DeviceChoice()), brakes=brakes
    )


def along(setting, motion):
    return stops_along(setting, motion.time, motion.q, motion.v)


def test_the_head_feels_the_arm_and_its_brake():
    """At w: a = (w² R, 0, g); then its brake takes T / J, and R T / J adds to it."""
    delay, T = 0.2, 7e3
    result = along(setting_of(delay, T), turning())
    R = np.hypot(*head_motion_of_samples(SDT, 1.0, *np.zeros((2, 2, 4))).position[0, :2])
    slowing = T / J
    time = np.arange(-0.2, delay + J * W / T + 0.2, 1e-3)
    w = np.clip(W - slowing * (time - delay), 0, W)
    along_arm = np.where((time >= delay) & (w > 0), slowing * R, 0.0)
    g = np.linalg.norm([w**2 * R, along_arm, np.full_like(w, GRAVITY)], axis=0) / GRAVITY
    assert worst(result, "g").value == pytest.approx(g.max(), rel=1e-4)
    onset = np.abs(g[100:] - g[:-100]).max() / 0.1
    assert worst(result, "g_onset").value == pytest.approx(onset, rel=0.01)
    assert worst(result, "head_rate").value == pytest.approx(W)
    assert worst(result, "head_acceleration").value == pytest.approx(slowing, rel=1e-6)
    assert worst(result, "stopping_time", 1).value == pytest.approx(delay + J * W / T)
    assert worst(result, "brake_energy", 1).value == pytest.approx(J * W**2 / 2, rel=1e-5)


def test_a_robot_without_head_has_no_figures_of_it():
    setting = make_setting(loaded(chain_sdf(3)), Stopping(motors=["AC-203"] * 3), DeviceChoice())
    result = along(setting, Motion.from_speeds(0.005, np.zeros(3), np.ones((3, 3))))
    assert "G" not in "".join(stop_findings(result)) and len(result.worst) == 5 * 3
    assert len(course_panels(result, result.course(0.0))) == 2


def test_a_run_of_another_robot_is_refused():
    design = sdt.design(sdt.load("coupled_pi"), motion=turning(duration=0.02))
    run = sdt.simulate(design)
    with pytest.raises(InputError, match=r"run: 3 joints, expected 4$"):
        stops(design, STOP, run=dataclasses.replace(run, q=run.q[:, :3]))


def test_a_sudden_change_of_g_is_measured_over_the_window():
    """A brake that stops the arm within 10 ms takes w² R from the head."""
    result = along(setting_of(0.0, J * W / 0.01, onset_window=0.2), turning())
    R = np.hypot(*head_motion_of_samples(SDT, 1.0, *np.zeros((2, 2, 4))).position[0, :2])
    most = np.hypot(np.hypot(W**2 * R, W / 0.01 * R), GRAVITY) / GRAVITY
    moving = np.hypot(W**2 * R, GRAVITY) / GRAVITY
    assert worst(result, "g_onset").value == pytest.approx((most - moving) / 0.2, rel=0.02)


def test_gravity_on_a_brake_is_its_share_where_the_joint_rests():
    q = np.tile([0, 0.5, 0.2, 0], (21, 1))
    result = along(setting_of(0.0), Motion(0.005, q, 0 * q, 0 * q))
    weight = torque_groups(SDT, q[0], *np.zeros((2, 4))).gravity
    for k in range(4):
        expected = abs(weight[k]) / 1e6
        assert worst(result, "brake_load", k + 1).value == pytest.approx(expected, abs=1e-12)


@pytest.mark.oracle
def test_stops_around_the_worst_ones_find_what_stops_at_every_sample_find():
    motion = sdt.plan("post_roll").motion
    start = 1304  # the largest G is that of a stop at 6.715 s
    short = Motion.from_speeds(0.005, motion.q[start], motion.v[start : start + 81])
    few, all_ = (found(short, {"every": every}) for every in (0.1, 0.005))
    assert len(few.time) < 0.5 * len(all_.time)
    for one, other in zip(few.worst, all_.worst, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-6), one.figure


@pytest.mark.parametrize("deceleration", [0.3, 3.0])
def test_a_ramp_is_as_long_as_the_torque_of_the_motors_requires(deceleration):
    motion = turning(duration=0.02)
    changes = {"category": 1, "deceleration": [deceleration, 9, 9, 9]}
    result = found(motion, changes)
    share, longer = worst(result, "drive_torque", 1).value, worst(result, "longer").value
    inertia = J + result.setting.brakes.inertia[0]
    needed = inertia * deceleration / SDT.effort_limit[0]
    if needed <= 1:
        assert longer == 1 and share == pytest.approx(needed, rel=1e-3)
    else:
        assert needed <= longer * 1.001 <= 1.01 * needed and 0.99 <= share <= 1
    assert worst(result, "stopping_time", 1).value == pytest.approx(longer * W / deceleration, 1e-3)


def test_a_motor_at_its_no_load_speed_has_no_torque_but_to_brake():
    setting = dataclasses.replace(setting_of(0.0), robot=falling(SDT, 1.0, 2.0))
    for torque, expected in ((0.0, 0), (-0.5 * SDT.effort_limit[0], 0.5), (1.0, np.inf)):
        v, tau = 2.0 * np.eye(1, 4), torque * np.eye(1, 4)
        course = SimpleNamespace(v=v, torque=tau, driven=np.ones((1, 4), dtype=bool))
        assert setting.drive_torque(course) == pytest.approx([expected, 0, 0, 0])


def test_a_failed_motor_leaves_its_joint_to_gravity_and_its_brake():
    motion = turning(0.5, roll=1.0, duration=0.1)
    both, failed = (found(motion, {"category": 2, "failed_motor": x}) for x in (None, 2))
    assert not both.figures["brake_energy"].any()
    energy = failed.figures["brake_energy"].max(axis=0) > 0
    assert energy.tolist() == [False, True, False, False]
    assert failed.figures["stopping_angle"][0, 1] != both.figures["stopping_angle"][0, 1]
    assert (failed.figures["drive_torque"][:, 1] == 0).all()


@pytest.mark.parametrize("ramp", ["joint", "coordinated"])
def test_a_failed_motor_has_no_ramp_and_lengthens_none(ramp):
    changes = {"category": 1, "deceleration": [1.0] * 4, "failed_motor": 2, "ramp": ramp}
    brakes = setting_of(0.3).brakes
    schedule = STOP.changed(changes).schedule(brakes, np.array([0.1, 5.0, 0.1, 0.2]))
    expected = [0.1, 0, 0.1, 0.2] if ramp == "joint" else [0.2, 0, 0.2, 0.2]
    np.testing.assert_allclose(schedule.ramp, expected)
    np.testing.assert_allclose(schedule.closed, [0.5, 0, 0.2, 0.2])
    np.testing.assert_allclose(schedule.released, [0.5, 0, 0.2, 0.2])


def test_friction_stops_as_in_fine_steps():
    table, none = loaded(RATE_TABLE, ".urdf"), np.zeros(3)
    friction = friction_parameters(Friction(coulomb=[3.0] * 3), 3)
    angles = []
    for accuracy in ({}, {"accuracy": 1e-7}):
        stopping = Stopping(motors=["AC-203"] * 3)
        setting = make_setting(table, stopping, DeviceChoice(), friction, **accuracy)
        setting = dataclasses.replace(setting, brakes=Brakes.of([None] * 3, table.gear_ratio))
        course, _ = setting.course(setting.plant(), none, np.array([0.2, 0.1, 0]))
        assert np.isfinite(course.stopping_time).all()
        angles.append(course.angle)
    np.testing.assert_allclose(*angles, rtol=1e-4, atol=1e-7)


def test_a_joint_tells_the_speed_at_which_it_reaches_its_stop():
    """The stop is 0.1 rad away: w² = w0² - 2 a (0.1), and 0 if the brake is stronger."""
    ends = np.array([0.1, np.inf, np.inf, np.inf])
    robot = dataclasses.replace(SDT, position_upper=ends, position_lower=-ends)
    start = turning(duration=0.005)  # one sample there
    for slowing in (2.0, 20.0):
        setting = dataclasses.replace(setting_of(0.0, J * slowing), robot=robot)
        expected = np.sqrt(max(0.0, W**2 - 2 * slowing * 0.1))
        value = along(setting, start).figures["joint_stop_speed"][0, 0]
        assert value == pytest.approx(expected, abs=0.01 * slowing), slowing


@pytest.mark.parametrize(
    ("changes", "fields", "message"),
    [
        ({}, {"plant.kind": "axis"}, "^plant.kind: axis, expected coupled"),
        ({}, {"plant.elasticity.natural_frequency": [60] * 4}, "^plant.elasticity: elastic joints"),
        ({"motors": []}, {}, "^motors: missing, expected the id of a motor.* for joint 1"),
        ({"motors": ["AC-203"]}, {}, r"motors: 1 value\(s\), expected 4"),
        ({"motors": ["AC-203", "TM-1", "TM-2150", "TM-2150"]}, {}, "no motor 'TM-1'"),
        ({"category": 1, "failed_motor": 5}, {}, "^failed_motor: 5, expected 1 to 4"),
        ({"failed_motor": 1}, {}, "failed_motor: has no effect in category 0"),
        ({"category": 2, "deceleration": None}, {}, "deceleration: missing, category 2 needs it"),
        ({"category": 3}, {}, "category: 3, expected"),
    ],
)  # fmt: skip
def test_stopping_that_does_not_fit_the_robot_is_refused(changes, fields, message):
    with pytest.raises(InputError, match=message):
        found(turning(), changes, **fields)


def test_a_motor_that_turns_with_two_joints_is_refused():
    with pytest.raises(InputError, match="a motor turns with two joints, and its brake would hold"):
        make_setting(loaded(WRIST), Stopping(motors=["AC-203", "AC-203"]), DeviceChoice())


def test_brakes_are_those_of_the_motors_that_the_scenario_names():
    names = ["AC-270", "TM-5270", "TM-2860", "TM-2860"]
    fitted = {"motors": names, "fitted": ["AC-203", "TM-3950", "TM-2150", "TM-2150"]}
    brakes = make_setting(sdt.load_robot(), STOP, DeviceChoice(**fitted)).brakes
    catalogue, ratio = load_catalogue(), [67.2, 1, 1, 1]
    own = [catalogue.motor(name, "").brake.static_torque for name in names]
    assert brakes.static.tolist() == pytest.approx(np.multiply(own, ratio))
    none = Brakes.of([None], np.array([67.2]))
    assert (none.static, none.dynamic, none.inertia) == (0, 0, 0)
    assert (none.delay, none.energy, none.source) == (np.inf, np.inf, ("no brake",))


@pytest.mark.parametrize("share", [1.01, 0.4])
def test_a_slower_motion_keeps_its_stops_within_limits(share):
    """The energy of the arm's brake falls with the square of the speed."""
    motion = turning()
    setting = setting_of(0.0, 5e4, energy=share * J * W**2 / 2)
    slow, factor = stoppable(setting, motion)
    assert factor == 2 ** (np.ceil(8 * max(0.0, np.log2(share**-0.5))) / 8)
    assert slow.v.max() == pytest.approx(W / factor)
    assert 0 <= slow.q[-1, 0] - motion.q[-1, 0] < W * 0.005  # it ends with a whole period
    assert along(setting, slow).share <= 1


def test_a_motion_whose_stops_exceed_a_limit_at_any_speed_is_refused():
    setting = setting_of(0.0, 5e4, energy=0.06 * J * W**2 / 2)
    message = (
        "a stop of category 0 at .* s: energy of a brake of joint 1 'planetary' is .* kJ at a 4th"
    )
    with pytest.raises(InputError, match=message):
        stoppable(setting, turning())


def test_table_of_stops_has_every_instant():
    motion = Motion.from_speeds(0.005, np.zeros(4), np.outer(np.linspace(W, 0.5, 44), [1, 0, 0, 0]))
    result = along(setting_of(0.0, 5e4), motion)
    table = result.to_pandas()
    assert table.index[-1] == motion.time[-1]  # from where no stop is the worst
    assert table.index.tolist() == result.time.tolist()
    assert table["stopping_time_1"].max() == worst(result, "stopping_time", 1).value
    assert result.hardest == result.time[result.figures["g"].argmax()]


PAGE = Path(__file__).parents[2] / ".github/docs/pages/howto/emergency_stops.md"


@pytest.mark.documents
def test_page_tells_what_the_shipped_device_does():
    """The stops at the worst instants of the whole run, which takes a minute."""
    design = sdt.design(sdt.load("coupled_pi_ctc"))
    run = sdt.simulate(design)
    rows = [round(time / 0.005) for time in (7.585, 9.645, 11.59, 16.085)]
    of = {}
    for category in (0, 1):
        stopping = load_stopping("stops", 4).changed({"category": category})
        setting = make_setting(design.device.simulated, stopping, DeviceChoice())
        instants = Along(setting, run.time, run.q, run.v).stops(rows)
        of[category] = {name: values.max() for name, values in instants.figures.items()}
    limit = load_catalogue().motor("AC-203", "").brake.energy
    words = " ".join(PAGE.read_text(encoding="utf-8").split())
    assert f"the head turns at {np.degrees(of[0]['head_rate']):.0f} deg/s" in words
    assert f"feels {of[0]['g']:.1f} G; in category 1 it feels {of[1]['g']:.1f} G" in words
    assert f"takes {of[0]['brake_energy'] / 1e3:.0f} kJ in category 0" in words
    assert f"is made for {limit / 1e3:g} kJ" in words
    assert (of[0]["stopping_time"] < 60) and (of[1]["drive_torque"] <= 1)
