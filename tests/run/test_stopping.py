"""Laws of a single emergency stop: brakes that slide and hold, ramps of drives, failed motors."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.robots import RATE_TABLE, chain_sdf, loaded
from oracles.braked import braked

from sdt_drake.robot.brakes import Brakes
from sdt_drake.robot.device import Friction, friction_parameters
from sdt_drake.robot.dynamics import inverse_dynamics, torque_groups
from sdt_drake.robot.robot import load_robot
from sdt_drake.robot.stops import Stops
from sdt_drake.run.stopping import Schedule, StopPlant, simulate_stop

SDT = load_robot()
Q, V = np.array([0.3, 0.5, -0.1, 0.2]), np.array([2.4, 1.5, 0.1, -0.2])
REST = np.zeros(4)
NEVER = np.full(4, np.inf)


def brakes(static, dynamic, delay=0.0, inertia=0.0):
    arrays = (np.broadcast_to(np.array(x, dtype=float), 4) for x in (static, dynamic, delay))
    return Brakes(*arrays, inertia=np.full(4, float(inertia)), energy=NEVER)


def power_off(own):
    at_once = np.zeros_like(own.delay)
    return Schedule(at_once, at_once, own.delay)


STRONG = brakes([1e4, 4e3, 2e3, 2e3], [8e3, 3e3, 1.6e3, 1.6e3], 0.1, 2.0)


@pytest.mark.parametrize("torque", [2e3, 7e3, 5e4])
def test_an_arm_in_its_brake_stops_after_j_w_over_t(torque):
    """With the others held, it turns about the vertical: t = d + J w / T, d w + J w² / (2 T)."""
    delay, w = 0.2, 2.4
    held = brakes([torque, 1e6, 1e6, 1e6], [torque, 1e6, 1e6, 1e6], [delay, 0, 0, 0], 50.0)
    course = simulate_stop(StopPlant(SDT, held), REST, np.array([w, 0, 0, 0]), power_off(held), 60)
    J = SDT.mass_matrix(SDT.context_at_zero())[0, 0] + 50
    assert course.stopping_time == pytest.approx([delay + J * w / torque, 0, 0, 0], rel=1e-6)
    assert course.angle == pytest.approx([delay * w + J * w**2 / (2 * torque), 0, 0, 0], rel=1e-6)
    assert course.brake_energy[0] == pytest.approx(J * w**2 / 2, rel=1e-5)


CHAINS = [loaded(chain_sdf(n, motors={"damping": np.zeros(n)})) for n in (1, 3)]


@pytest.mark.parametrize("robot", [SDT, *CHAINS], ids=["sdt", "1 joint", "3 joints"])
def test_brakes_take_the_energy_of_a_robot(robot):
    n, plant, share = robot.n, robot.make_plant(), 1 if robot is SDT else 0.01
    context, of = plant.CreateDefaultContext(), (STRONG.static, STRONG.dynamic, STRONG.inertia)
    static, dynamic, inertia = (share * x[:n] for x in of)
    own = Brakes(static, dynamic, STRONG.delay[:n], inertia, NEVER[:n])

    def energy(q, v):
        plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
        moving = plant.CalcKineticEnergy(context) + (own.inertia * v**2).sum() / 2
        return moving + plant.CalcPotentialEnergy(context)

    course = simulate_stop(StopPlant(robot, own), Q[:n], V[:n], power_off(own), 60)
    lost = energy(Q[:n], V[:n]) - energy(course.q[-1], course.v[-1])
    assert course.brake_energy.sum() == pytest.approx(lost, rel=1e-5)
    assert (course.brake_energy > 0).all() and not course.v[-1].any()


@pytest.mark.parametrize("share, held", [(1.001, True), (0.999, False)])
def test_a_brake_holds_up_to_its_static_torque_without_creep(share, held):
    """A roll of 90 degrees: below it the joint slides off, and the dynamic torque brakes it."""
    q = np.array([0, np.pi / 2, 0, 0])
    weight = torque_groups(SDT, q, REST, REST).gravity[1]
    own = brakes([1e6, share * abs(weight), 1e6, 1e6], [1e6, 0.5 * abs(weight), 1e6, 1e6])
    schedule = Schedule(np.full(4, 2.0), REST, own.delay)  # so that it goes on for 2 s
    course = simulate_stop(StopPlant(SDT, own), q, REST, schedule, 2.0)
    assert np.array_equal(course.q[-1], q) == held
    if not held:
        J = SDT.mass_matrix(SDT.context_at_zero())[1, 1]
        assert course.vd[0, 1] == pytest.approx(-weight / 2 / J, rel=1e-6)


@pytest.mark.parametrize("coordinated", [False, True])
def test_drives_follow_their_ramps_with_the_torque_of_inverse_dynamics(coordinated):
    ramp = np.full(4, 5.0) if coordinated else np.array([5.0, 0.5, 0.2, 0.1])
    end = ramp.max() + STRONG.delay
    course = simulate_stop(StopPlant(SDT, STRONG), Q, V, Schedule(ramp, end, end), 60)
    assert course.stopping_time == pytest.approx(ramp, abs=1e-9)
    assert course.angle == pytest.approx(np.abs(V) * ramp / 2, rel=1e-6)
    needed = inverse_dynamics(SDT, course.q, course.v, course.vd) + 2.0 * course.vd
    np.testing.assert_allclose(course.torque, needed, rtol=0, atol=0.01)
    assert course.driven[0].all() and not course.driven[-1].any()


def test_friction_stops_a_vertical_axis_without_brakes():
    """J w' = -F - b w: t = (J / b) log(1 + b w / F), to where it is at rest."""
    table = loaded(RATE_TABLE, ".urdf")
    n, none, F, w = table.n, np.zeros(table.n), 3.0, 0.5
    own = Brakes(none, none, none + np.inf, none, none + np.inf)
    friction = friction_parameters(Friction(coulomb=[F] * n), n)
    schedule = Schedule(none, none, own.delay)
    course = simulate_stop(StopPlant(table, own, friction), none, np.array([w, 0, 0]), schedule, 60)
    J, b = table.mass_matrix(table.context_at_zero())[0, 0], table.damping[0]
    expected = J / b * np.log1p(b * w / F) if b else J * w / F
    assert course.stopping_time[0] == pytest.approx(expected, abs=0.05)
    assert not course.brake_energy.any()


@pytest.mark.parametrize("way, end", [(-1, -0.3), (1, 0.1)])
def test_a_joint_stop_takes_up_the_energy_of_an_arm_without_brake(way, end):
    """J w² = k x², and back again."""
    w, k = 0.8, 1e6
    ends = [np.array([x, *[way * np.inf] * 3]) for x, way in ((-0.3, -1), (0.1, 1))]
    robot = replace(SDT, position_lower=ends[0], position_upper=ends[1])
    own = brakes([0, 1e6, 1e6, 1e6], [0, 1e6, 1e6, 1e6], [np.inf, 0, 0, 0])
    plant = StopPlant(robot, own, stops=Stops(stiffness=[k, 0, 0, 0]))
    course = simulate_stop(plant, REST, np.array([way * w, 0, 0, 0]), power_off(own), 0.9)
    x = w * np.sqrt(SDT.mass_matrix(SDT.context_at_zero())[0, 0] / k)
    assert (way * course.q[:, 0]).max() == pytest.approx(way * end + x, rel=1e-3)
    assert course.v[-1, 0] == pytest.approx(-way * w, rel=1e-3)


SLOW = V * [0.5, 1, 1, 1]
CASES = {
    "power off": (SLOW, REST, REST, STRONG.delay),
    "power off while it all turns": ([-1.0, 1.5, -0.2, 0.8], REST, REST, STRONG.delay),
    "coordinated ramp": (SLOW, [2.5] * 4, [2.6] * 4, [2.6] * 4),
    "ramps of their own": (SLOW, [2.5, 0.5, 0.2, 0.1], [2.6] * 4, [2.6] * 4),
    "motor 2 failed": (SLOW, [2.5, 0, 2.5, 2.5], [2.6, 0, 2.6, 2.6], [2.6, 0.1, 2.6, 2.6]),
}


@pytest.mark.oracle
@pytest.mark.parametrize("case", CASES)
def test_stops_agree_with_impulses_in_small_steps(case):
    v, *schedule = map(np.array, CASES[case])
    course = simulate_stop(StopPlant(SDT, STRONG), Q, v, Schedule(*schedule), 60)
    time, angle = braked(SDT, STRONG, Q, v, *schedule)
    assert course.stopping_time == pytest.approx(time, rel=1e-3, abs=1e-3)
    assert course.angle == pytest.approx(angle, rel=1e-3, abs=1e-4)


def test_a_stop_does_not_depend_on_those_before_it():
    plant = StopPlant(SDT, STRONG)
    first, _, again = (simulate_stop(plant, Q, v, power_off(STRONG), 60).q for v in (V, -V, V))
    np.testing.assert_array_equal(first, again)
