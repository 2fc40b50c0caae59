"""Loops with parts of different periods, against maps by hand, python-control and simulation."""

import control
import numpy as np
import pytest
from helpers.variants import kind
from oracles.two_mass import cascade_map
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

import sdt_drake as sdt
from sdt_drake.analysis.frequency_response import frequency_response
from sdt_drake.robot.device import Drive
from sdt_drake.run.controllers import CONTROLLERS

T = 0.005
DRIVES = [None, 0.001]


def cascade(designed, k_v, drive, name="coupled_pi", **given):
    return designed(name, kind("p_pi", position_gain=k_v) | {"drive": Drive(period=drive)}, **given)


# --- the position loop of a cascade -------------------------------------------------------------


@pytest.mark.parametrize("drive", DRIVES)
def test_cascade_on_an_axis_equals_its_sampled_map(designed, drive):
    """Cut at the samples of the position: margins as python-control tells them of that map."""
    k_v = np.array([3.0, 60.0, 150.0, 20.0])
    design = cascade(designed, k_v.tolist(), drive, "axis_pi")
    response = frequency_response(design, points=1500)
    omega = response.omega
    assert response.at_positions and omega[-1] == pytest.approx(np.pi / T)
    for k, inertia in enumerate(design.i_eff):
        gains = design.tuning.gains.kp[[[k]]], design.tuning.gains.ki[[[k]]]
        motor = np.array([[0.0, 1], [0, 0]]), np.array([[0], [1 / inertia]])
        A, B = cascade_map(*motor, np.array([[0.0, 1]]), gains, T, drive)
        by_hand = control.ss(A, B, np.eye(2, 3), 0, T)
        position, speed = by_hand.frequency_response(omega).complex[:, 0]
        gain = k_v[k] * position
        np.testing.assert_allclose(response.loop_gain[:, k], gain, rtol=1e-6)
        expected = (1 + k_v[k] / (1j * omega)) * speed / (1 + gain)
        np.testing.assert_allclose(response.tracking[:, k], expected, rtol=1e-6, atol=1e-9)
        loop = k_v[k] * by_hand[0, 0]
        factor, angle, _, _, crossover, _ = control.stability_margins(loop, method="frd")
        assert response.gain_margin[k] == pytest.approx(factor, rel=1e-4)
        assert response.phase_margin[k] == pytest.approx(angle, abs=0.01)
        assert response.crossover[k] == pytest.approx(crossover, rel=1e-4)


@pytest.mark.parametrize(("drive", "k_v"), [(None, 400.0), (0.001, 120.0)])
def test_simulated_load_step_equals_linear_model(designed, k_v, drive):
    """A step of load on joint 2: positions, less those without it, decay or run away as told."""
    design, load = cascade(designed, [k_v] * 4, drive, end=0.2), np.array([0, 300.0, 0, 0])

    def run(load):
        builder = DiagramBuilder()
        loop = sdt.loop(design)
        builder.AddSystem(loop.diagram)
        source = builder.AddSystem(ConstantVectorSource(load))
        builder.Connect(source.get_output_port(), loop.GetInputPort("extra_load_torque"))
        return sdt.simulate(loop, builder.Build()).q

    model = design.linear()
    frequencies = control.damp(model.to_control(), doprint=False)[0]
    np.testing.assert_allclose(np.sort(np.abs(model.modes())), np.sort(frequencies), rtol=1e-6)
    x, expected = np.zeros(len(model.A)), []
    for _ in design.reference.tracked.time:
        expected.append(model.C[:4] @ x)
        x = model.A @ x - model.B[:, 12:] @ load  # beside tau_ff
    answer = run(load) - run(0 * load)
    assert np.abs(answer - expected).max() < 0.01 * np.abs(expected).max()


# --- the model in state space -------------------------------------------------------------------

ENCODERS = {"drive": Drive(period=0.001, encoder_resolution=[1e6] * 4)}


@pytest.mark.parametrize("fields", [{}, ENCODERS], ids=["ideal", "encoders"])
@pytest.mark.parametrize("name", CONTROLLERS)
def test_linear_model_is_controllable_and_observable(designed, name, fields):
    """Drake's own inverse dynamics has an integral of the gain 0, which nothing shows."""
    design = designed("coupled_pi", fields | kind(name), end=0.5)
    model = design.linear(20)
    slow = name in ("p_pi", "inverse_dynamics")
    assert model.period == pytest.approx(T if slow else design.drive.period or 0, rel=1e-8)
    assert model.to_control().dt == model.period
    at = {state: i for i, state in enumerate(model.states)}
    assert len(at) == len(model.A)
    for k in range(1, 5):
        assert model.C[model.outputs.index(f"q_{k}"), at[f"q_{k}"]] == 1
        if fields and name != "p_pi":  # at the drive's samples, which are those of the model
            np.testing.assert_allclose(model.A[at[f"q_before_{k}"]], np.eye(len(at))[at[f"q_{k}"]])
    for A, B in ((model.A, model.B), (model.A.T, model.C.T)):
        for mode in np.linalg.eigvals(A):  # Popov, Belevitch, Hautus: of full rank at every mode
            test = np.hstack([mode * np.eye(len(A)) - A, B])
            for axis in 20 * (1, 0):  # rows and columns in units of their own
                test = test / np.maximum(np.abs(test).max(axis=axis, keepdims=True), 1e-12)
            assert np.linalg.svd(test, compute_uv=False).min() > 1e-6
