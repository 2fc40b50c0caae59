"""The error budget: its parts, each against a calculation by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from by_hand import rk4
from test_linear import R
from variants import kind

from sdt_drake.analysis.budget import PARTS, error_budget
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.run.loop import Loop
from sdt_drake.run.plant import steady
from sdt_drake.run.scenario import DisturbanceChoice, with_fields
from sdt_drake.run.simulate import simulate
from sdt_drake.run.tuning import Feedforward

PERIOD = 0.005
ACCELERATION = np.array([0.2, 0.5, 0.05, 0.1])  # rad/s², for 0.8 s
START = np.array([0.0, 0.4, -0.1, 0.2])
FRICTION = Friction([270.0, 80, 43, 43], [100.0, 10, 10, 10])
PI = {"algorithm": "consistent"}
CTC = PI | {"disturbance": DisturbanceChoice(0.05)}
ID = PI | kind("p_pi", feedforward="id")


@pytest.fixture(scope="module")
def short():
    """0.8 s of constant acceleration, 0.2 s of constant speed."""
    t = PERIOD * np.arange(201)
    return Motion.from_speeds(PERIOD, START, np.outer(np.clip(t, 0, 0.8), ACCELERATION))


@pytest.fixture(scope="module")
def budgets(designed, short):
    """A budget by scenario and fields, computed once: design and budget."""
    made = {}

    def get(name="axis_pi", fields=None):
        key = name, repr(fields)
        if key not in made:
            design = designed(name, fields, motion=short)
            made[key] = design, error_budget(design)
        return made[key]

    return get


def largest(values):
    return np.abs(values).max(axis=0)


def same(actual, expected, tolerance):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance)


# --- the sum ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("axis_pi", PI),
        ("axis_pi_ctc", CTC),
        ("axis_pi", ID),
        ("axis_pi_ctc", CTC | {"drive": Drive(period=0.001, torque_error=[0.02, 0, 0, -0.02])}),
        ("axis_pi_ctc", CTC | {"plant.elasticity": Elasticity([0, 65.991, 0, 0])}),
        ("axis_pi", ID | {"controller.anti_windup": True}),
    ],
    ids=["pi", "pi_ctc", "p_pi+id", "sampled", "elastic", "anti_windup"],
)
def test_parts_of_a_linear_loop_add_up(budgets, name, fields):
    design, budget = budgets(name, fields)

    assert tuple(budget.parts) == PARTS
    same(sum(budget.parts.values()) + budget.remainder, budget.whole, 1e-15)
    same(budget.remainder, 0, 1e-6)
    same(budget.parts["saturation"], 0, 1e-6)
    assert np.all(largest(budget.whole) > 1e-4)
    np.testing.assert_array_equal(budget.time, design.motion.time)


def test_design_is_left_alone(budgets):
    design, _ = budgets("axis_pi_ctc", CTC)
    assert design.scenario.disturbance.amplitude == 0.05
    assert design.motion.v.any() and design.loads.load_torque.any()


# --- each part ----------------------------------------------------------------------------------


def linear_loop(design, torque_at, v_ref, carried=0.0):
    """Speed of the motors under PI with P in the feedback path; torque_at(t, i) loads them.

    The integral starts with what is carried.
    """
    kp, ki, inertia = design.gains.kp, design.gains.ki, design.i_eff

    def law(i):
        def derivative(t, state):
            w, x = np.split(state, 2)
            w_ref = R * v_ref[i]
            tau = ki * x - kp * w - torque_at(t, i)
            return np.concatenate([tau / inertia, w_ref - w])

        return derivative

    start = np.concatenate([np.zeros(4), carried / ki * np.ones(4)])
    states = rk4(law, start, design.motion.time, 4)
    return states[:, :4] / R


def test_reference_lag_is_the_loop_without_load(budgets):
    design, budget = budgets("axis_pi", PI)
    v = linear_loop(design, lambda t, i: 0, design.motion.v)
    # The last sample arrives at its own instant: the reference before it was still in force.
    same(budget.parts["reference lag"], v - design.motion.v, 1e-5)


def test_load_is_what_the_load_torque_does(budgets):
    design, budget = budgets("axis_pi", PI)
    load = design.loads.load_torque
    at_rest = np.zeros_like(design.motion.v)
    carried = design.steady_load(steady(design.motion))
    expected = linear_loop(design, lambda t, i: load[i], at_rest, carried)

    assert largest(carried) > 100
    same(budget.parts["load"], expected, 1e-5)
    assert largest(expected).max() > 0.005
    same(budget.parts["disturbance"], 0, 0)


def test_half_a_feedforward_leaves_half_the_load(budgets):
    _, whole = budgets("axis_pi", PI)
    _, half = budgets("axis_pi", PI | kind("pi_ctc", feedforward_gain=[0.5] * 4))
    same(half.parts["load"], whole.parts["load"] / 2, 1e-6)
    same(half.parts["reference lag"], whole.parts["reference lag"], 1e-6)


def test_disturbance_is_what_the_model_does_not_know(budgets):
    design, budget = budgets("axis_pi_ctc", CTC)
    load, omega_d = design.loads.load_torque, 2 * np.pi

    def unknown(t, i):
        return 0.05 * np.sin(omega_d * t) * load[i]

    expected = linear_loop(design, unknown, np.zeros_like(design.motion.v))
    same(budget.parts["disturbance"], expected, 1e-5)
    assert largest(expected).max() > 1e-3


@pytest.mark.parametrize(
    ("fields", "compensated"),
    [(PI, {}), (CTC | kind("pi_ctc"), {}), (PI, {"controller.friction_compensation": True})],
    ids=["pi", "pi_ctc", "compensated"],
)
def test_friction_lands_in_the_remainder(budgets, fields, compensated):
    """And so does what its compensation takes of it."""
    _, without = budgets("axis_pi", fields)
    _, budget = budgets("axis_pi", fields | {"plant.friction": FRICTION} | compensated)

    for name in PARTS:
        same(budget.parts[name], without.parts[name], 1e-6)
    same(budget.remainder, budget.whole - without.whole, 1e-5)
    assert largest(budget.remainder).max() > 1e-3


def test_increments_of_encoders_land_in_the_remainder(budgets):
    """A speed is a difference of positions either way: the finer encoders leave nothing over."""
    coarse, fine = (
        budgets("axis_pi_ctc", CTC | {"drive": Drive(period=0.001, encoder_resolution=[x] * 4)})[1]
        for x in (1e6, 1e9)
    )
    for name in PARTS:
        same(coarse.parts[name], fine.parts[name], 1e-6)
    assert largest(coarse.remainder).max() > 30 * largest(fine.remainder).max()
    same(coarse.remainder, coarse.whole - fine.whole, 1e-5)


def test_parts_are_what_the_loop_loses_without_its_blocks(budgets):
    design, budget = budgets("axis_pi_ctc", CTC)
    exact = replace(design, scenario=replace(design.scenario, accuracy=2e-6))
    calm = replace(exact, scenario=with_fields(exact.scenario, {"disturbance.amplitude": 0.0}))
    bare = replace(calm, fed=Feedforward())  # CTC answers the load alone
    free, undisturbed, unloaded = (
        simulate(d, Loop(d, limited=False, loaded=loaded)).speed_error
        for d, loaded in ((exact, True), (calm, True), (bare, False))
    )
    same(budget.parts["saturation"], budget.whole - free, 1e-15)
    same(budget.parts["disturbance"], free - undisturbed, 1e-15)
    same(budget.parts["load"], undisturbed - unloaded, 1e-15)
    same(budget.parts["reference lag"], unloaded, 1e-15)
    # Without limits nothing saturates, without a load nothing is carried at the start.
    start = simulate(bare, Loop(bare, limited=False, loaded=False))
    same(start.tau_cmd[0], 0, 1e-9)
    assert np.abs(simulate(calm).tau_cmd[0]).max() > 100


def test_saturation_is_a_part(designed):
    """axis_pi as printed, from 8.9 to 9.6 s: motor 2 saturates."""
    reference, i = designed("axis_pi").motion, round(8.9 / PERIOD)
    motion = Motion.from_speeds(PERIOD, reference.q[i], reference.v[i : i + 141])
    design = designed("axis_pi", motion=motion)
    assert design.scenario.algorithm == "printed"
    recording = simulate(design)
    budget = error_budget(design)

    saturated = (recording.tau_limited != recording.tau_cmd).any(axis=0)
    assert saturated.tolist() == [False, True, False, False]
    assert largest(budget.parts["saturation"])[1] > 0.05
    same(budget.parts["saturation"][:, ~saturated], 0, 1e-6)
    same(sum(budget.parts.values()) + budget.remainder, budget.whole, 1e-15)
    same(budget.remainder, 0, 1e-5)
    same(budget.whole, recording.speed_error, 1e-3)


def test_envelope_counts_as_saturation(designed, budgets, short):
    envelope = Drive(n1=[5.0, 0.1, 1, 1], n0=[30.0, 0.5, 2, 2])
    _, free = budgets("axis_pi", PI)
    budget = error_budget(designed("axis_pi", PI | {"drive": envelope}, motion=short))

    assert largest(budget.parts["saturation"])[1] > 1e-3
    for name in ("reference lag", "load"):
        same(budget.parts[name], free.parts[name], 1e-6)
    same(budget.remainder, 0, 1e-6)


# --- what it is not for -------------------------------------------------------------------------


def test_coupled_plant_is_refused(designed):
    with pytest.raises(InputError, match=r"plant\.kind: coupled; .*expected axis"):
        error_budget(designed("coupled_pi", end=0.1))


def test_online_inverse_dynamics_is_refused(designed):
    with pytest.raises(InputError, match=r"inverse_dynamics: online; .*requires table"):
        error_budget(designed("axis_pi_ctc", {"inverse_dynamics": "online"}, end=0.1))
