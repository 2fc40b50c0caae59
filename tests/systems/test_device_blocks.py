"""Friction, encoder, torque loop and elastic joints alone: what must hold physically.

Their laws are tested with all others in test_laws.py.
"""

import dataclasses

import numpy as np
import pytest
from alone import FRICTION, GEAR, LIMIT, PERIOD, ROTORS, SPRINGS, Alone, N, close, exact
from pydrake.systems.primitives import Linearize

from sdt_drake.device import OVERFLOW_RATE, Springs, sliding_friction
from sdt_drake.systems import (
    elastic_joints_block,
    encoder_block,
    friction_block,
    torque_loop_block,
)

RNG = np.random.default_rng(5)

# --- friction --------------------------------------------------------------------------------


class Joints(Alone):
    """The friction block in physical units, joint side."""

    def __init__(self, friction=FRICTION):
        super().__init__(friction_block, friction=friction)
        self.friction = friction

    def at(self, z, v):
        """Friction [N m] and dz/dt [rad/s] with bristles of length z [rad] at v [rad/s]."""
        unit = 100 * self.friction.presliding  # of the state
        self.context.SetContinuousState(np.broadcast_to(z, N) / unit)
        self.give(state=[*RNG.normal(size=N), *np.broadcast_to(v, N)])
        return GEAR * self.output("friction"), unit * self.derivatives()


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("speed", [*np.logspace(-9, 1, 11), 0.02, 0.019, 0.05])
def test_steady_sliding_has_the_sliding_friction(speed, way):
    v = way * speed
    force, rate = Joints().at(way * (FRICTION.presliding + speed / OVERFLOW_RATE), v)
    assert np.all(np.abs(rate) <= 1e-12 * speed + 1e-18)
    np.testing.assert_allclose(force, sliding_friction(FRICTION, np.full(N, v)), rtol=1e-9)


@pytest.mark.parametrize("way", [1, -1])
def test_bristles_come_to_rest_where_sliding_is_steady(way):
    """From anywhere dz/dt leads there."""
    joints = Joints()
    for speed in (1e-6, 1e-3, 1.0):
        rest = way * (FRICTION.presliding + speed / OVERFLOW_RATE)
        for z in (-2 * rest, 0.0, 0.5 * rest, 0.99 * rest, 1.01 * rest, 3 * rest):
            _, rate = joints.at(z, way * speed)
            assert np.all(rate * (rest - z) > 0)


@pytest.mark.parametrize("share", [-0.999, -0.5, -1e-6, 0.0, 0.3, 0.999])
def test_a_joint_at_rest_holds_a_load_below_coulomb_and_does_not_creep(share):
    force, rate = Joints().at(share * FRICTION.presliding, 0.0)
    close(force, share * FRICTION.coulomb)
    exact(rate, np.zeros(N))


def test_a_joint_at_rest_holds_no_more_than_coulomb():
    """Also where breakaway friction is larger."""
    joints = Joints()
    for z in np.linspace(-20, 20, 81) * FRICTION.presliding:
        force, _ = joints.at(z, 0.0)
        assert np.all(np.abs(force) <= FRICTION.coulomb * (1 + 1e-12))


def test_overstretched_bristles_slip_back_at_the_overflow_rate():
    for way in (1, -1):
        _, rate = Joints().at(way * 3 * FRICTION.presliding, 0.0)
        close(rate, np.full(N, -way * 2 * OVERFLOW_RATE * FRICTION.presliding))


def test_friction_is_largest_at_the_stribeck_speed():
    friction = dataclasses.replace(FRICTION, viscous=np.zeros(N))
    forces = []
    for speed in np.array([0.5, 0.9, 1.0, 1.1, 2.0]) * friction.stribeck_speed:
        force, _ = Joints(friction).at(friction.presliding + speed / OVERFLOW_RATE, speed)
        forces.append(force)
    np.testing.assert_allclose(forces[2], friction.breakaway, rtol=1e-9)
    stribeck = friction.breakaway > friction.coulomb
    assert np.all(np.argmax(forces, axis=0)[stribeck] == 2)


def test_friction_only_takes_energy():
    """F v - dW/dt >= 0, with W = int F_c clip(z / z_c) dz stored in the bristles."""
    joints, z_c = Joints(), FRICTION.presliding
    for _ in range(5000):
        z = RNG.choice([-1, 1], size=N) * z_c * 10 ** RNG.uniform(-3, 3, size=N)
        v = RNG.choice([-1, 1], size=N) * 10 ** RNG.uniform(-9, 1, size=N)
        force, rate = joints.at(z, v)
        stored = FRICTION.coulomb * np.clip(z / z_c, -1, 1) * rate
        lost = force * v - stored
        round_off = 1e-12 * (np.abs(force * v) + np.abs(stored))
        assert np.all(lost >= -round_off)


def test_friction_is_odd_and_knows_no_position():
    joints = Joints()
    for _ in range(20):
        z, v = FRICTION.presliding * RNG.normal(size=N), 0.03 * RNG.normal(size=N)
        force, rate = (a.copy() for a in joints.at(z, v))
        mirrored, mirrored_rate = joints.at(-z, -v)  # at other positions too
        exact(mirrored, -force)
        exact(mirrored_rate, -rate)


def test_no_friction_is_zero():
    none = dataclasses.replace(
        FRICTION, coulomb=np.zeros(N), viscous=np.zeros(N), breakaway=np.zeros(N)
    )
    for _ in range(5):
        force, _ = Joints(none).at(FRICTION.presliding * RNG.normal(size=N), RNG.normal(size=N))
        exact(np.abs(force), np.zeros(N))


# --- encoder ---------------------------------------------------------------------------------

RESOLUTION = np.array([50.0, 60.0, 70.0])


def encoder_of(resolution=RESOLUTION, **changes):
    return Alone(encoder_block, resolution=resolution, gear_ratio=GEAR, **changes)


def test_ideal_encoder_samples_and_holds():
    block = Alone(encoder_block)
    assert block.timing == (0, PERIOD)
    first, second = RNG.normal(size=(2, 2 * N))
    block.give(state=first)
    exact(block.output("state"), np.zeros(2 * N))  # nothing sampled yet
    block.sample()
    exact(block.output("state"), first)  # in force from its own instant on
    block.give(state=second)
    block.context.SetTime(0.9 * PERIOD)
    exact(block.output("state"), first)
    block.sample(time=PERIOD)
    exact(block.output("state"), second)


def test_increments_are_those_of_the_motor():
    block = encoder_of()
    assert block.timing == (0, PERIOD)
    increment = 2 * np.pi / (RESOLUTION * GEAR)
    for count in (-3, -1, 0, 1, 2, 1000):
        for share in (0.01, 0.5, 0.99):
            block.give(state=[*((count + share) * increment), *RNG.normal(size=N)])
            block.sample()
            close(block.output("state")[:N], count * increment)  # rounded down, also below zero


def test_one_turn_of_the_joint_has_resolution_times_gear_ratio_positions():
    block = encoder_of()
    seen = []
    for q in np.linspace(0, 2 * np.pi, 20001)[:-1] + 1e-5:
        block.give(state=[*np.full(N, q), *np.zeros(N)])
        block.sample()
        seen.append(block.output("state")[:N].copy())
    counts = [len(np.unique(column)) for column in np.transpose(seen)]
    exact(counts, RESOLUTION * GEAR)


def test_measured_speed_is_the_difference_of_two_positions():
    block = encoder_of(period=PERIOD / 4)
    assert block.timing == (0, PERIOD / 4)
    increment = 2 * np.pi / (RESOLUTION * GEAR)
    before = np.zeros(N)  # what it holds before the first sample
    for k in range(20):
        q = RNG.normal(size=N)
        block.give(state=[*q, *(1e9 * RNG.normal(size=N))])  # true speeds it does not see
        block.sample(time=k * PERIOD / 4)
        position = np.floor(q / increment) * increment
        expected = [*position, *((position - before) / (PERIOD / 4))]
        np.testing.assert_allclose(block.output("state"), expected, rtol=1e-12, atol=1e-9)
        block.give(state=RNG.normal(size=2 * N))  # held
        np.testing.assert_allclose(block.output("state"), expected, rtol=1e-12, atol=1e-9)
        before = position


def test_measured_speed_at_rest_is_zero_from_the_second_sample_on():
    block = encoder_of()
    block.give(state=[*RNG.normal(size=N), *np.zeros(N)])
    block.sample()
    assert np.all(block.output("state")[N:] != 0)
    for _ in range(3):
        block.sample()
        exact(block.output("state")[N:], np.zeros(N))


def test_measured_speed_lags_by_half_a_period():
    """Where the joints accelerate steadily, but for the resolution."""
    block = encoder_of(resolution=[2.0**26] * N)
    acceleration, v0 = np.array([3.0, -2.0, 0.5]), np.array([0.1, 2.0, -1.0])
    for k in range(1, 10):
        t = k * PERIOD
        block.give(state=[*(v0 * t + acceleration * t**2 / 2), *np.zeros(N)])
        block.sample(time=t)
        if k > 1:
            expected = v0 + acceleration * (t - PERIOD / 2)
            error = 2 * np.pi / 2**26 / GEAR / PERIOD  # of one increment
            assert np.all(np.abs(block.output("state")[N:] - expected) <= error)


# --- torque loop -----------------------------------------------------------------------------

ERROR = np.array([0.05, -0.1, 0.0])


def test_ideal_torque_loop_passes_every_bit():
    block = Alone(torque_loop_block)
    assert block.context.num_continuous_states() == 0
    for tau in [*RNG.normal(size=(100, N)) * LIMIT, 1e-300 * LIMIT, 1e300 * LIMIT, np.zeros(N)]:
        block.give(tau_limited=tau)
        exact(block.output("tau"), tau)


def test_torque_error_is_a_gain():
    block = Alone(torque_loop_block, error=ERROR)
    tau = RNG.normal(size=N)
    block.give(tau_limited=tau)
    close(block.output("tau"), [1.05, 0.9, 1.0] * tau)


def test_lagging_torque_starts_at_zero_and_settles_at_what_it_should_be():
    block = Alone(torque_loop_block, bandwidth=300.0, error=ERROR)
    tau = LIMIT * [0.5, -1.0, 0.3]
    block.give(tau_limited=tau)
    exact(block.output("tau"), np.zeros(N))
    settled = [1.05, 0.9, 1.0] * tau
    # In units of 100 limits.
    close(block.derivatives() * 100 * LIMIT, 2 * np.pi * 300 * settled)
    block.context.SetContinuousState(settled / LIMIT / 100)
    close(block.output("tau"), settled)
    close(block.derivatives(), np.zeros(N))


@pytest.mark.parametrize("error", [None, ERROR])
@pytest.mark.parametrize("bandwidth", [1.0, 300.0, 2000.0])
def test_gain_has_fallen_by_3_db_at_the_bandwidth(bandwidth, error):
    block = Alone(torque_loop_block, bandwidth=bandwidth, error=error)
    block.give(tau_limited=np.zeros(N))
    linear = Linearize(block.diagram, block.context)
    gain = np.ones(N) if error is None else 1 + error
    for frequency in np.array([1e-3, 0.1, 1.0, 3.0, 100.0]) * bandwidth:
        s = 2j * np.pi * frequency
        G = linear.C() @ np.linalg.solve(s * np.eye(N) - linear.A(), linear.B()) + linear.D()
        by_hand = gain / (1 + s / (2 * np.pi * bandwidth))
        np.testing.assert_allclose(G, np.diag(by_hand), rtol=1e-9, atol=1e-12)
        if frequency == bandwidth:
            close(np.abs(G.diagonal()), gain / np.sqrt(2))


# --- elastic joints --------------------------------------------------------------------------

ALL = Springs(np.full(N, True), np.array([9e5, 8.0, 4e3]), np.array([700.0, 0.0, 5.0]))


class Joint(Alone):
    """Elastic joints at random torques and states; arrays of shape (n,), 0 rates where rigid."""

    def __init__(self, springs):
        super().__init__(elastic_joints_block, springs=springs)
        axes = springs.elastic
        tau, q, v = RNG.normal(size=(3, N))
        theta, w = np.where(axes, RNG.normal(size=(2, N)), [q, v])
        self.tau, self.q, self.v, self.theta, self.w = 100 * tau, q, v, theta, w
        self.give(tau=self.tau, state=[*q, *v])
        self.context.SetContinuousState([*theta[axes], *w[axes]])
        self.tau_link = self.output("tau_link")
        self.motor_state = self.output("motor_state")
        self.wd = np.zeros(N)
        thetad, self.wd[axes] = np.split(self.derivatives(), 2)
        exact(thetad, w[axes])


SPRUNG = pytest.mark.parametrize("springs", [SPRINGS, ALL], ids=["some", "all"])


def test_rigid_joints_pass_every_bit():
    for _ in range(20):
        joint, rigid = Joint(SPRINGS), ~SPRINGS.elastic
        exact(joint.tau_link[rigid], joint.tau[rigid])
        exact(joint.motor_state.reshape(2, N)[:, rigid], [joint.q[rigid], joint.v[rigid]])


@SPRUNG
def test_springs_and_dampers_carry_the_link(springs):
    joint, axes = Joint(springs), springs.elastic
    force = springs.stiffness * (joint.theta - joint.q) + springs.damping * (joint.w - joint.v)
    close(joint.tau_link[axes], (force / GEAR)[axes])
    exact(joint.motor_state, [*joint.theta, *joint.w])


@SPRUNG
def test_springs_at_rest_carry_nothing(springs):
    joint, axes = Joint(springs), springs.elastic
    joint.context.SetContinuousState([*joint.q[axes], *joint.v[axes]])
    assert np.all(np.abs(joint.output("tau_link")[axes]) <= 1e-15 * springs.stiffness[axes])


@SPRUNG
def test_action_equals_reaction(springs):
    """Momentum of motor and link, joint side, changes by r tau alone: springs are inside."""
    for _ in range(20):
        joint, axes = Joint(springs), springs.elastic
        motor, link = GEAR**2 * ROTORS * joint.wd, GEAR * joint.tau_link
        scale = 1e-12 * (1 + np.abs(link) + np.abs(joint.tau))
        assert np.all(np.abs(motor + link - GEAR * joint.tau)[axes] <= (GEAR * scale)[axes])


@SPRUNG
def test_energy_is_lost_in_the_dampers_alone(springs):
    """r tau w goes in; r tau_link v goes on; the motor and the spring store, the damper loses."""
    for _ in range(20):
        joint, axes = Joint(springs), springs.elastic
        stored = (
            GEAR**2 * ROTORS * joint.w * joint.wd
            + springs.stiffness * (joint.theta - joint.q) * (joint.w - joint.v)
        )  # fmt: skip
        balance = GEAR * (joint.tau * joint.w - joint.tau_link * joint.v) - stored
        lost = springs.damping * (joint.w - joint.v) ** 2
        np.testing.assert_allclose(balance[axes], lost[axes], rtol=1e-9, atol=1e-6)


def test_natural_frequency_is_that_of_the_spring_between_motor_and_link():
    """The link held: k / (r² I_m) of each motor, from the linearised block."""
    block = Alone(elastic_joints_block, springs=dataclasses.replace(ALL, damping=np.zeros(N)))
    block.give(tau=np.zeros(N), state=np.zeros(2 * N))
    found = np.sort(np.abs(np.linalg.eigvals(Linearize(block.diagram, block.context).A())))
    by_hand = np.sqrt(ALL.stiffness / GEAR**2 / ROTORS)
    np.testing.assert_allclose(found, np.sort(np.repeat(by_hand, 2)), rtol=1e-9)
