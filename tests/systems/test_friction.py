"""Friction is bounded by its largest value, takes energy, and stops a joint as by hand."""

import numpy as np
import pytest
from helpers.alone import FRICTION, GEAR, N
from hypothesis import given
from hypothesis import strategies as st
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LinearSystem, LogVectorOutput

from sdt_drake.robot.device import (
    OVERFLOW_RATE,
    PRESLIDING_DAMPING_TIME,
    Friction,
    friction_parameters,
    sliding_friction,
    sliding_stretch,
)
from sdt_drake.run.device import make_device, viscous_only
from sdt_drake.run.simulate import make_simulator
from sdt_drake.systems import joint_friction
from sdt_drake.systems.friction import set_sliding

BLOCK = joint_friction(friction=FRICTION, gear_ratio=GEAR)


def force_and_rate(stretch, v):
    """Return F - F_0 [N m] and the rate of z / z_c [1/s] of bristles at z / z_c, joint side."""
    force, rate = torque_and_rate(BLOCK, stretch, v)
    return GEAR * force - FRICTION.offset, rate


def torque_and_rate(block, stretch, v):
    """Return the block's output [N m], motor side, and the rate of z / z_c [1/s]."""
    context = block.CreateDefaultContext()
    context.SetContinuousState(stretch / 100)  # the state's unit
    block.get_input_port().FixValue(context, np.append(np.zeros(len(v)), v))
    rate = 100 * block.EvalTimeDerivatives(context).CopyToVector()
    return block.get_output_port().Eval(context), rate


def vectors(size):
    """Draw numbers of all sizes up to one: sticking joints are slow, sliding ones fast."""
    one = st.builds(
        lambda sign, power: sign * size * 10**power,
        st.sampled_from([-1.0, 0.0, 1.0]),
        st.floats(-8, 0),
    )
    return st.lists(one, min_size=N, max_size=N).map(np.array)


@given(stretch=vectors(500.0), v=vectors(20.0))
def test_friction_is_bounded_by_breakaway_and_dissipates(stretch, v):
    """The bristles store W = int F_c clip(z / z_c) dz; power beyond dW/dt is heat."""
    force, rate = force_and_rate(stretch, v)
    largest = FRICTION.breakaway + FRICTION.viscous * np.abs(v)
    assert np.all(np.abs(force) <= largest * (1 + 1e-12))
    stored = FRICTION.coulomb * np.clip(stretch, -1, 1) * FRICTION.presliding * rate
    assert np.all(force * v - stored >= -1e-9 * np.abs(force * v))


@given(v=vectors(20.0))
def test_steady_sliding_friction_is_one_law_everywhere(v):
    force, rate = force_and_rate(sliding_stretch(FRICTION, v), v)
    np.testing.assert_allclose(force + FRICTION.offset, sliding_friction(FRICTION, v), rtol=1e-9)
    assert np.all(np.abs(rate) <= 1e-9 * np.abs(v) / FRICTION.presliding)


def slope(block, stretch, v):
    """Return the derivative of the block's output with respect to v [N m s/rad]."""
    step = 1e-7  # rad/s; T times it is 5e-5 of z_c
    up, down = (torque_and_rate(block, stretch, v + s * step)[0] for s in (1, -1))
    return (up - down) / (2 * step)


@given(stretch=vectors(500.0), v=vectors(20.0))
def test_friction_slope_is_bounded_by_the_checked_poles(stretch, v):
    """A sticking joint has T F_c / z_c, a creeping one up to 2 (F_b - F_c) / v_s, and all b."""
    sticking = PRESLIDING_DAMPING_TIME * FRICTION.coulomb / FRICTION.presliding
    peak = (FRICTION.breakaway - FRICTION.coulomb) / FRICTION.stribeck_speed
    steepest = GEAR * slope(BLOCK, stretch, v)
    assert np.all(steepest <= (sticking + 2 * peak + FRICTION.viscous) * (1 + 1e-4))
    at_rest = GEAR * slope(BLOCK, np.zeros(N), np.zeros(N))
    assert at_rest == pytest.approx(sticking + np.exp(0.5) * peak + FRICTION.viscous, rel=1e-4)


def test_linear_loop_has_viscous_slope_of_fast_sliding(designed):
    """`bode`, `linear`, `stability` and the check of `learn` are made from one process."""
    design = designed("real_device")
    block = joint_friction(friction=design.friction, gear_ratio=design.device.simulated.gear_ratio)
    fast = np.array([2.0, -2.0, 3.0, -3.0])  # rad/s
    found = slope(block, sliding_stretch(design.friction, fast), fast)
    linear = make_device(viscous_only(design)).GetSubsystemByName("friction")
    gain = linear.GetSubsystemByName("viscous").D()
    expected = np.hstack([np.zeros((4, 4)), np.diag(found)])
    np.testing.assert_allclose(gain, expected, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("load", [0.0, 0.7, -0.9])
def test_sliding_joint_stops_where_by_hand_and_sticks(load):
    """Deceleration (F_c + load) / J: J v² / 2 / (F_c + load) and J v / (F_c + load), then rest."""
    coulomb, inertia, v_0 = 80.0, 5.0, 0.8
    only_coulomb = friction_parameters(Friction(coulomb=[coulomb]), 1)
    builder = DiagramBuilder()
    # d[q, v]/dt = [v, (-load - friction) / J]; the load enters as a state that stays.
    A, B = [[0, 1, 0], [0, 0, -1 / inertia], [0, 0, 0]], [[0.0], [-1 / inertia], [0.0]]
    C = np.eye(2, 3)
    joint = builder.AddSystem(LinearSystem(np.array(A, dtype=float), B, C, np.zeros((2, 1)), 0.0))
    friction = builder.AddSystem(joint_friction(friction=only_coulomb, gear_ratio=[1.0]))
    builder.Connect(joint.get_output_port(), friction.get_input_port())
    builder.Connect(friction.get_output_port(), joint.get_input_port())
    log = LogVectorOutput(joint.get_output_port(), builder, publish_period=0.001)
    simulator = make_simulator(builder.Build(), period=0.005, accuracy=1e-6)
    context = simulator.get_mutable_context()
    start = np.array([0.0, v_0, load * coulomb])
    joint.GetMyMutableContextFromRoot(context).SetContinuousState(start)
    own = friction.GetMyMutableContextFromRoot(context)
    set_sliding(friction, own, [v_0], friction=only_coulomb)
    stops = inertia * v_0 / (coulomb * (1 + load))
    simulator.AdvanceTo(stops + 1.0)
    q, v = log.FindLog(context).data()
    time = log.FindLog(context).sample_times()
    np.testing.assert_allclose(v[time < stops], (v_0 * (1 - time / stops))[time < stops], atol=2e-5)
    # A bristle relaxes with a lag of 1 / lambda, and so swings the joint back by up to a / lambda².
    back = coulomb * (1 + load) / inertia / OVERFLOW_RATE**2
    assert q[-1] == pytest.approx(v_0 * stops / 2, abs=1e-5 + back)
    assert np.abs(v[time > stops + 0.1]).max() < 1e-6
