"""From a flight to a motion: limits at every 5 ms, figures recomputed, other robots, interrupts."""

import signal
from dataclasses import replace

import numpy as np
import pytest
from helpers.robots import chain_sdf, loaded
from oracles.pinocchio_model import pinocchio_torque
from scipy.signal import lsim
from scipy.spatial.transform import Rotation

from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import watching
from sdt_drake.machine.cueing import procedure
from sdt_drake.machine.cueing.felt import felt, followed, unfelt
from sdt_drake.machine.cueing.flight import make_flight, read_flight
from sdt_drake.machine.cueing.online_flight import with_online
from sdt_drake.machine.cueing.problem import Problem, Trajectory, Weights
from sdt_drake.machine.cueing.procedure import Effort, fly
from sdt_drake.machine.cueing.program import rated
from sdt_drake.machine.cueing.search import Ended, is_within, reasons, unexcelled
from sdt_drake.motion import Motion, load_plan
from sdt_drake.motion.trajectory import interpolated
from sdt_drake.pilot import load_perception
from sdt_drake.pilot.head import GRAVITY, head_motion
from sdt_drake.pilot.orientation import perceive
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.show.reports.fly import _starts, fly_report

ONE_START = Effort(seats=(0.0,), front=(0.1, 10.0))
# At such a weight of G the motors are used as far as they may.
QUICK = {"approach": 4.0, "departure": 4.0, "knot": 0.4, "g_weight": 30.0, "effort": ONE_START}
FRAME = '<frame name="head" attached_to="link_3"><pose>0.1 -0.2 0.3 1 2 3</pose></frame>'


def piece(first, last):
    """Seconds of the shipped flight."""
    flight = read_flight("turn")
    own = (flight.time >= first) & (flight.time <= last)
    return make_flight(flight.time[own], flight.specific_force[own], flight.angular_rate[own])


@pytest.fixture(scope="module")
def onset():
    """The roll into the turn, 1 to 1.5 G."""
    return piece(5.0, 8.0)


@pytest.fixture(scope="module")
def flown(robot, onset):
    return fly(robot, onset, **QUICK)


def used(robot, motion):
    """Largest share of each motor's torque at both ends of every period."""
    q, v, vd = motion.q, motion.v, np.diff(motion.v, axis=0) / motion.period
    both = [inverse_dynamics(robot, q[k], v[k], vd) for k in (slice(-1), slice(1, None))]
    return np.abs(both).max(axis=(0, 1)) / robot.effort_limit


@pytest.mark.oracle
def test_flight_made_by_a_motion_gives_that_motion_back(robot):
    """What the device itself can do, from the head's motion alone."""
    t = 0.005 * np.arange(1601)
    v = np.zeros((len(t), 4))
    ease = np.sin(np.pi * np.clip((t - 2) / 4, 0, 1)) ** 2
    v[:, 1], v[:, 3] = 0.25 * ease * np.sin(0.8 * t), 0.2 * ease * np.cos(0.6 * t)
    motion = Motion.from_speeds(0.005, np.zeros(4), v)
    head = head_motion(robot, motion.q, motion.v, motion.vd)
    flight = make_flight(motion.time, head.specific_force, head.angular_velocity)
    found = fly(robot, flight, approach=2.0, departure=2.0, knot=0.2, torque_margin=1.0,
                compare=False, effort=ONE_START)  # fmt: skip
    within = found.chosen.within
    force = np.abs(found.chosen.force_error[within]).max(axis=0)
    rate = np.degrees(np.abs(found.chosen.felt_rate_error[within]).max(axis=0))
    assert np.all(force < 0.1 * np.array([0.063, 0.057, 0.154]))
    assert np.all(rate < 0.1 * np.array([2.04, 2.07, 1.58]))


def test_online_cueing_is_told_beside_the_found_motion(flown):
    result = with_online(flown, None)
    assert [one.name for one in result.online] == ["online, program", "online, washout"]
    assert result.candidates[-2:] == [*result.online] and result.motion is flown.motion
    told = result.numbers["online"]["program"]
    g, _, vertical = result.online[0].errors(flown.felt)
    assert told["g_error_rms"] == g and told["idle_g"] == 1.4 and told["kept_plans"] == 0
    text = f"the online program has G ({g:.3f} instead of {flown.chosen.g_error:.3f} G), felt"
    assert text in result.online_answer and f"({vertical:.1f} instead of" in result.online_answer
    assert "a plan takes" in result.online_answer and "of the 200 ms" in result.online_answer
    assert f"- **Online:** {result.online_answer}." in fly_report(result).markdown()


def test_old_candidate_name_works_and_warns(flown):
    with pytest.warns(DeprecationWarning, match="options is candidates now, and goes in 0.7"):
        assert flown.options == flown.candidates


@pytest.mark.oracle
def test_random_robot_with_head_flies_within_limits(onset):
    robot = loaded(chain_sdf(3, motors={"effort": np.full(3, 20.0)}, extra=FRAME))
    found = fly(robot, onset, compare=False, torque_margin=1.0, **QUICK)
    assert 0.9 < used(robot, found.motion).max() <= 1
    with pytest.raises(InputError, match="no pilot's head"):
        fly(loaded(chain_sdf(3)), onset)


@pytest.mark.oracle
def test_idle_g_is_reached_in_the_approach(robot):
    ends = {"approach": 6.0, "departure": 2.0, "knot": 0.5, "compare": False, "effort": ONE_START}
    found = fly(robot, piece(0.0, 1.0), idle_g=1.4, g_weight=3.0, **ends)
    at = round(0.8 * 6 / 0.005)
    assert found.chosen.head.resultant_g[at] == pytest.approx(1.4, abs=0.1)


def test_interrupted_search_keeps_the_best_candidate(robot, onset):
    pressed = []

    def interrupt(done):
        if done > 0.03 and not pressed:
            pressed.append(done)
            raise KeyboardInterrupt

    with watching(interrupt):
        try:
            found = fly(robot, onset, **QUICK)
        except KeyboardInterrupt:  # which pytest would not count as a failure
            pytest.fail("the best so far is lost")
    assert found.numbers["interrupted"] and not found.numbers["starts"]
    assert found.unlimited is None and found.chosen.g_error < found.rest.g_error
    assert used(robot, found.motion).max() < 0.95 * 1.01
    assert not _starts(found).rows  # of the page, which is written, too


@pytest.mark.parametrize("stage", ["_still", "aligned", "reasons"])
def test_signal_before_or_after_the_search_loses_no_motion(robot, onset, stage, monkeypatch):
    """It arrives while a stage computes; the first stage finds the device at rest."""
    own = getattr(procedure, stage)

    def interrupted(*given):
        signal.raise_signal(signal.SIGINT)
        return own(*given)

    monkeypatch.setattr(procedure, stage, interrupted)
    try:
        found = fly(robot, onset, **QUICK)
    except KeyboardInterrupt:  # which pytest would not count as a failure
        pytest.fail("the motion is lost")
    assert found.numbers["interrupted"]
    assert is_within(robot, found.motion, 0.95)
    if stage != "reasons":
        assert found.alignment.name == "alignment left out: at rest"
        assert "left out" in fly_report(found).markdown()


def end(cost, arm, seat):
    """The end of a start by its cost, the speed of the arm and the angle of the seat [rad]."""
    q = np.column_stack([arm * np.arange(3.0), np.full(3, seat)])
    return Ended(None, Trajectory(1.0, q, 0 * q, 0 * q, cost), 0)


def test_reasons_compare_with_the_nearest_of_the_best_ends():
    forth, back, turned = end(1.0, 2.0, 0.0), end(1.02, -2.0, 0.5), end(1.2, -1.0, 0.6 - 2 * np.pi)
    near = "joint 2 is turned by 6 deg"
    assert reasons(True, [forth, back, turned]) == ["", "", near]
    assert reasons(True, [turned, forth]) == ["the arm turns the other way", ""]
    far = "joint 1 is turned by 100 deg"  # by 0, 172 and 16 deg
    assert reasons(False, [turned, forth]) == [far, ""]
    assert reasons(True, []) == []


BAD = [
    ({"knot": 3.0}, "knot: 3 s, expected at most 1 s"),
    ({"knot": 0.0123}, "knot: 0.0123 s is not a whole multiple of the period 0.005 s"),
    ({"approach": -1.0}, "approach: -1.0, expected a finite number > 0"),
    ({"idle_g": 0.5}, "idle_g: 0.5 G, expected 1 to 10 G"),
    ({"g_weight": 0.0}, "g_weight: 0.0, expected"),
    ({"torque_margin": 1.2}, "torque_margin: 1.2, expected"),
]


@pytest.mark.parametrize("options, told", BAD, ids=[case[-1] for case in BAD])
def test_bad_options_of_fly_are_refused_before_any_search(robot, onset, options, told):
    with pytest.raises(InputError, match=f"^{told}"):
        fly(robot, onset, **options)


def test_pinocchios_torques_of_a_flown_motion_are_within_the_limits(robot, flown):
    motion, every = flown.motion, 7
    q, v, vd = (x[::every] for x in (motion.q, motion.v, motion.vd))
    links = [pinocchio_torque(robot, *row) for row in zip(q, v, vd, strict=True)]
    torque = np.array(links) + vd * robot.reflected_inertia
    np.testing.assert_allclose(torque, inverse_dynamics(robot, q, v, vd), rtol=1e-6, atol=1e-3)
    share = np.abs(torque).max(axis=0) / robot.effort_limit
    assert 0.85 < share.max() < 0.95 * 1.01


def test_forces_of_all_directions_have_one_weight_as_in_the_told_error(robot):
    """At rest, with errors of 1 m/s² along one axis: W / s_g² for 5 knots of 0.4 s."""
    still, model = Trajectory(0.4, *np.zeros((3, 5, 4))), load_perception("slow_yaw")
    force = head_motion(robot, still.q, still.v, still.a).specific_force
    costs = []
    for axis in np.eye(3):
        head = np.hstack([force + axis, np.zeros((5, 3))])
        percept = felt(model, unfelt(head - np.pad(axis, (0, 3))), head - np.pad(axis, (0, 3)))
        problem = Problem(
            robot, model, 0.4, head, percept, np.ones((5, 2)), Weights(g=3.0), np.inf,
            robot.position_lower, robot.position_upper, arm=True,
        )  # fmt: skip
        costs.append(rated(problem, still).merit)
    np.testing.assert_allclose(costs, 5 * 0.4 * 3.0 / 0.154**2 / 2)


def test_course_between_knots_is_exact():
    rng = np.random.default_rng(2)
    h, a = 0.4, rng.normal(size=(6, 2))
    v = np.vstack([np.zeros(2), np.cumsum(h * (a[1:] + a[:-1]) / 2, axis=0)])
    steps = h * v[:-1] + h * h * (a[:-1] / 3 + a[1:] / 6)
    trajectory = Trajectory(h, np.vstack([np.zeros(2), np.cumsum(steps, axis=0)]), v, a)
    fine = trajectory.refined()
    assert fine.knot == 0.2
    np.testing.assert_array_equal(fine.q[::2], trajectory.q)
    t = 0.2
    again = fine.v[:-1] + t * (fine.a[1:] + fine.a[:-1]) / 2
    np.testing.assert_allclose(again, fine.v[1:], atol=1e-12)
    again = fine.q[:-1] + t * fine.v[:-1] + t * t * (fine.a[:-1] / 3 + fine.a[1:] / 6)
    np.testing.assert_allclose(again, fine.q[1:], atol=1e-12)
    motion = trajectory.motion
    np.testing.assert_allclose(motion.v[40:-1:40], fine.v[1:-1], atol=1e-12)


def head_by_hand(q, v):
    """Place [m], rotation and rate in its own axes [rad/s] of the shipped device's head."""
    turned = Rotation.identity(len(q))
    place, rate = np.zeros((len(q), 3)), np.zeros((len(q), 3))
    for k, axis in enumerate([[0.0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, 1]]):
        rate += v[:, k, None] * turned.apply(axis)
        turned = turned * Rotation.from_rotvec(q[:, k, None] * axis)
        if k == 0:
            place += turned.apply([2.6, 0, 0])
    place += turned.apply([0, -0.13, 0.33])
    turned = turned * Rotation.from_euler("z", np.pi / 2)
    return place, turned, turned.inv().apply(rate)


def high_passed(error, period):
    """A signal through 5.7 s / (5.7 s + 1), at zero before its first sample, by scipy."""
    return lsim(([5.7, 0], [5.7, 1]), error, period * np.arange(len(error)))[1]


def test_motion_keeps_all_limits_at_every_sample(robot, flown, tmp_path):
    motion, share = flown.motion, used(robot, flown.motion)
    assert share.max() == pytest.approx(flown.numbers["torque_share_max"], rel=1e-9)
    assert 0.9 < share.max() < 0.95 * 1.01
    assert np.all(np.abs(motion.v).max(axis=0) < robot.velocity_limit)
    assert not np.any(motion.v[[0, -1]])
    motion.to_csv(tmp_path / "motion.csv")
    assert not load_plan(tmp_path / "motion.csv", robot).limited.any()


def test_figures_equal_independent_kinematics(onset, flown):
    """Rotations of scipy with numbers of the SDF; force from differences of the head's places."""
    motion, period = flown.motion, flown.motion.period
    place, turned, rate = head_by_hand(motion.q, motion.v)
    force = np.diff(place, 2, axis=0) / period**2 + [0, 0, GRAVITY]
    time = motion.time[1:-1] - flown.numbers["flight_starts_at"]
    own = (time > -1e-9) & (time < onset.duration + 1e-9)
    shown = turned[1:-1].inv().apply(force), rate[1:-1]
    f, w = (
        values - np.stack([np.interp(time, onset.time, x) for x in flight.T], axis=1)
        for values, flight in zip(shown, (onset.specific_force, onset.angular_rate), strict=True)
    )
    g = np.sqrt(np.mean(np.sum(f[own] ** 2, axis=1))) / GRAVITY
    assert flown.numbers["g_error_rms"] == pytest.approx(g, rel=0.01)
    felt = np.degrees(np.sqrt(sum(np.mean(high_passed(x, period) ** 2) for x in w[own].T)))
    assert flown.numbers["felt_rotation_from_zero_rms_deg_s"] == pytest.approx(felt, rel=1e-6)
    whole = np.stack([high_passed(x, period)[own] for x in (w - w[0]).T])  # from steady state
    felt = np.degrees(np.sqrt(np.sum(np.mean(whole**2, axis=1))))
    assert flown.numbers["felt_rotation_rms_deg_s"] == pytest.approx(felt, rel=1e-3)


@pytest.mark.parametrize(("share", "keeps"), [(0.9, True), (1.0, False)])
def test_torque_between_knots_may_exceed_the_share_but_not_the_motors(robot, flown, share, keeps):
    limit = robot.effort_limit * used(robot, flown.motion) / (1.001 * share)
    assert is_within(replace(robot, effort_limit=limit), flown.motion, share) == keeps


def test_no_motion_that_was_found_excels_the_chosen_one_or_one_on_the_front(flown):
    """Nor does rest or the alignment, and the front leads from the smallest G error to rest."""
    starts, front = flown.numbers["starts"], flown.numbers["front"]
    names = "g_error_rms", "felt_rotation_rms_deg_s", "felt_vertical_rms_deg"
    found = flown.numbers, flown.numbers["rest"], *starts, *front
    own, rest, *others = (np.array([one[name] for name in names]) for one in found)
    for one in (rest, *others):
        assert not (np.all(one <= own) and np.any(one < own))
    for point in front:
        point = np.array([point[name] for name in names])
        assert not any(np.all(one <= point) and np.any(one < point) for one in (rest, *others))
    g = [point["g_error_rms"] for point in front]
    assert g == sorted(g) and front[-1]["g_weight"] == 0


def test_unexcelled_errors_of_a_table():
    errors = [(2.0, 2.0), (1.0, 3.0), (2.0, 2.0), (3.0, 3.0), (2.0, 1.0), (0.5, 9.0)]
    assert unexcelled(errors) == [5, 1, 4]


def test_device_at_rest_is_tilted_along_the_mean_of_felt_gravity(robot, flown):
    """By a search over two gimbals with rotations of scipy."""
    rest, mean = flown.rest, -flown.felt.gravity.mean(axis=0)
    assert not rest.motion.v.any()
    up = rest.head.specific_force[0] / GRAVITY
    assert up @ mean / np.linalg.norm(mean) == pytest.approx(1, abs=1e-4)
    assert rest.felt_rotation == pytest.approx(
        np.degrees(np.sqrt(sum(
            np.mean(lsim(([5.7, 0], [5.7, 1]), x - x[0], flown.felt.time)[1] ** 2)
            for x in flown.felt.angular_rate.T
        ))), rel=0.01,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["slow_yaw", "clark2019", "irmak2023"])
def test_percept_at_knots_is_that_of_the_observer_without_its_cut_off(name):
    flight = read_flight("turn")
    model = replace(load_perception(name), cutoff=50.0)
    knots = 0.2 * np.arange(51)
    head = np.hstack(flight.at(knots))
    own = felt(model, followed(model, head, 0.2), head)
    time = 0.04 * np.arange(251)
    force, rate = np.split(interpolated(time, knots, head), 2, axis=1)
    percept = perceive(time, force, rate, model)
    shown = np.hstack([percept.gravity, percept.rate, percept.acceleration])[::5]
    np.testing.assert_allclose(own[:, :3], shown[:, :3], atol=np.radians(0.5))
    np.testing.assert_allclose(own[:, 3:6], shown[:, 3:6], atol=np.radians(0.5))
    np.testing.assert_allclose(own[1:, 6:], shown[1:, 6:], atol=0.05)
