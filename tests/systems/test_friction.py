"""Friction is bounded by its largest value, takes energy, and stops a joint as by hand."""

import numpy as np
import pytest
from alone import FRICTION, GEAR, N
from hypothesis import given
from hypothesis import strategies as st
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LinearSystem, LogVectorOutput

from sdt_drake.robot.device import OVERFLOW_RATE, Friction, friction_parameters
from sdt_drake.run.simulate import make_simulator
from sdt_drake.systems import JointFriction

BLOCK = JointFriction(friction=FRICTION, gear_ratio=GEAR)


def force_and_rate(stretch, v):
    """Return F - F_0 [N m] and the rate of z / z_c [1/s] of bristles at z / z_c, joint side."""
    context = BLOCK.CreateDefaultContext()
    context.SetContinuousState(stretch / 100)  # the state's unit
    BLOCK.get_input_port().FixValue(context, np.append(np.zeros(N), v))
    force = GEAR * BLOCK.get_output_port().Eval(context) - FRICTION.offset
    return force, 100 * BLOCK.EvalTimeDerivatives(context).CopyToVector()


def vectors(size):
    """Draw numbers of all sizes up to one: sticking joints are slow, sliding ones fast."""
    one = st.builds(
        lambda sign, power: sign * size * 10**power,
        st.sampled_from([-1.0, 0.0, 1.0]),
        st.floats(-8, 0),
    )
    return st.lists(one, min_size=N, max_size=N).map(np.array)


@given(stretch=vectors(500.0), v=vectors(20.0))
def test_no_motion_gives_more_friction_than_breakaway_or_any_energy(stretch, v):
    """The bristles store W = int F_c clip(z / z_c) dz; power beyond dW/dt is heat."""
    force, rate = force_and_rate(stretch, v)
    largest = FRICTION.breakaway + FRICTION.viscous * np.abs(v)
    assert np.all(np.abs(force) <= largest * (1 + 1e-12))
    stored = FRICTION.coulomb * np.clip(stretch, -1, 1) * FRICTION.presliding * rate
    assert np.all(force * v - stored >= -1e-9 * np.abs(force * v))


@pytest.mark.parametrize("load", [0.0, 0.7, -0.9])
def test_a_joint_slides_to_rest_as_by_hand_and_stays(load):
    """Deceleration (F_c + load) / J: J v² / 2 / (F_c + load) and J v / (F_c + load), then rest."""
    coulomb, inertia, v_0 = 80.0, 5.0, 0.8
    only_coulomb = friction_parameters(Friction(coulomb=[coulomb]), 1)
    builder = DiagramBuilder()
    # d[q, v]/dt = [v, (-load - friction) / J]; the load enters as a state that stays.
    A, B = [[0, 1, 0], [0, 0, -1 / inertia], [0, 0, 0]], [[0.0], [-1 / inertia], [0.0]]
    C = np.eye(2, 3)
    joint = builder.AddSystem(LinearSystem(np.array(A, dtype=float), B, C, np.zeros((2, 1)), 0.0))
    friction = builder.AddSystem(JointFriction(friction=only_coulomb, gear_ratio=[1.0]))
    builder.Connect(joint.get_output_port(), friction.get_input_port())
    builder.Connect(friction.get_output_port(), joint.get_input_port())
    log = LogVectorOutput(joint.get_output_port(), builder, publish_period=0.001)
    simulator = make_simulator(builder.Build(), period=0.005, accuracy=1e-6)
    context = simulator.get_mutable_context()
    start = np.array([0.0, v_0, load * coulomb])
    joint.GetMyMutableContextFromRoot(context).SetContinuousState(start)
    friction.rest(friction.GetMyMutableContextFromRoot(context), [v_0])
    stops = inertia * v_0 / (coulomb * (1 + load))
    simulator.AdvanceTo(stops + 1.0)
    q, v = log.FindLog(context).data()
    time = log.FindLog(context).sample_times()
    np.testing.assert_allclose(v[time < stops], (v_0 * (1 - time / stops))[time < stops], atol=2e-5)
    # A bristle relaxes with a lag of 1 / lambda, and so swings the joint back by up to a / lambda².
    back = coulomb * (1 + load) / inertia / OVERFLOW_RATE**2
    assert q[-1] == pytest.approx(v_0 * stops / 2, abs=1e-5 + back)
    assert np.abs(v[time > stops + 0.1]).max() < 1e-6
