"""The error budget: its parts add up, and each is the one calculated by hand."""

import numpy as np
import pytest
from helpers.variants import kind
from oracles.by_hand import GEAR, rk4

from sdt_drake.analysis.budget import PARTS, error_budget
from sdt_drake.io.errors import InputError
from sdt_drake.motion import LearnedReference, Motion
from sdt_drake.robot.device import Drive, Friction
from sdt_drake.run.plant import steady
from sdt_drake.run.scenario import DisturbanceChoice
from sdt_drake.run.simulate import simulate

PERIOD = 0.005
ACCELERATION = np.array([0.2, 0.5, 0.05, 0.1])  # rad/s², for 0.8 s
START = np.array([0.0, 0.4, -0.1, 0.2])
FRICTION = Friction([270.0, 80, 43, 43], [100.0, 10, 10, 10])
PI = {"algorithm": "consistent"}
CTC = PI | {"disturbance": DisturbanceChoice(0.05)}


@pytest.fixture(scope="module")
def budgets(designed):
    """A budget by scenario and fields; 0.8 s of constant acceleration, 0.2 s of constant speed."""
    made = {}
    speed = np.outer(np.clip(PERIOD * np.arange(201), 0, 0.8), ACCELERATION)
    short = Motion.from_speeds(PERIOD, START, speed)

    def get(name="axis_pi", fields=None):
        key = name, repr(fields)
        if key not in made:
            design = designed(name, fields, motion=short)
            made[key] = design, error_budget(design)
        return made[key]

    return get


def largest(values):
    return np.abs(values).max(axis=0)


def same(actual, expected, tolerance=1e-6):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance)


def linear_loop(design, torque_at, v_ref, carried=0.0):
    """Speed of the motors under PI with P in the feedback path; torque_at(t, i) loads them.

    The integral starts with what is carried.
    """
    kp, ki, inertia = design.tuning.gains.kp, design.tuning.gains.ki, design.i_eff

    def law(i):
        def derivative(t, state):
            w, x = np.split(state, 2)
            tau = ki * x - kp * w - torque_at(t, i)
            return np.concatenate([tau / inertia, GEAR * v_ref[i] - w])

        return derivative

    start = np.concatenate([np.zeros(4), carried / ki * np.ones(4)])
    return rk4(law, start, design.reference.tracked.time, 4)[:, :4] / GEAR


def test_budget_parts_equal_those_by_hand(budgets):
    design, budget = budgets("axis_pi_ctc", CTC | kind("pi_ctc", feedforward_gain=[0.5] * 4))
    load, v_ref = design.loads.load_torque, design.reference.tracked.v
    # The last sample arrives at its own instant: the reference before it was still in force.
    lag = linear_loop(design, lambda t, i: 0, v_ref) - v_ref
    carried = 0.5 * design.loads_along(steady(design.reference.tracked)).load_torque[0]
    unfed = linear_loop(design, lambda t, i: 0.5 * load[i], 0 * v_ref, carried)
    unknown = linear_loop(design, lambda t, i: 0.05 * np.sin(2 * np.pi * t) * load[i], 0 * v_ref)
    for part, expected in (("reference lag", lag), ("load", unfed), ("disturbance", unknown)):
        assert largest(expected).max() > 1e-3
        same(budget.parts[part], expected, 1e-5)


CTC_AT_1_MS = CTC | {"drive": Drive(period=0.001, encoder_resolution=[1e9] * 4)}


@pytest.mark.parametrize(
    ("name", "linear", "changed"),
    [
        ("axis_pi", PI, {"plant.friction": FRICTION}),
        ("axis_pi", PI, {"plant.friction": FRICTION, "controller.friction_compensation": True}),
        ("axis_pi_ctc", CTC_AT_1_MS, {"drive": Drive(period=0.001, encoder_resolution=[1e6] * 4)}),
    ],
    ids=["friction", "its compensation", "increments of encoders"],
)
def test_nonlinear_error_lands_in_the_remainder(budgets, name, linear, changed):
    (_, without), (_, budget) = budgets(name, linear), budgets(name, linear | changed)
    for part in PARTS:
        same(budget.parts[part], without.parts[part])
    same(budget.remainder, budget.whole - without.whole, 1e-5)
    assert largest(budget.remainder).max() > 30 * largest(without.remainder).max()


def test_budget_of_learned_or_other_feedforward_is_refused(budgets):
    design, _ = budgets()
    with pytest.raises(InputError, match="learned: has no part in an error budget"):
        error_budget(
            design.given(LearnedReference(design.reference.planned, 0 * design.reference.planned.q))
        )
    with pytest.raises(InputError, match="design: another torque feedforward than"):
        error_budget(design.with_feedforward(0 * design.reference.planned.q))
    with pytest.raises(InputError, match="inverse_dynamics: online; an error budget requires"):
        budgets("axis_pi_ctc", {"inverse_dynamics": "online"})


def test_saturation_is_a_budget_part(designed):
    """axis_pi as printed, from 8.9 to 9.6 s: motor 2 saturates."""
    reference, i = designed("axis_pi").reference.tracked, round(8.9 / PERIOD)
    motion = Motion.from_speeds(PERIOD, reference.q[i], reference.v[i : i + 141])
    design = designed("axis_pi", motion=motion)
    recording, budget = simulate(design), error_budget(design)
    saturated = (recording.tau_limited != recording.tau_cmd).any(axis=0)
    assert saturated.tolist() == [False, True, False, False]
    assert largest(budget.parts["saturation"])[1] > 0.05
    same(budget.parts["saturation"][:, ~saturated], 0)
    assert tuple(budget.parts) == PARTS
    same(sum(budget.parts.values()), budget.whole, 1e-5)
    same(budget.remainder, budget.whole - sum(budget.parts.values()), 1e-15)
    same(budget.whole, recording.speed_error, 1e-3)
