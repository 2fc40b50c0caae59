"""Loops with parts of different periods, against maps by hand, python-control and simulation."""

from __future__ import annotations

import control
import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from test_linear import R, cascade_map, matrices
from variants import kind

import sdt_drake as sdt
from sdt_drake.analysis.frequency_response import frequency_response
from sdt_drake.robot.device import Drive
from sdt_drake.run.controllers import CONTROLLERS

T = 0.005
DRIVES = [None, 0.001]


def cascade(designed, k_v, drive, name="coupled_pi", **given):
    return designed(name, kind("p_pi", position_gain=k_v) | {"drive": Drive(period=drive)}, **given)


def closed(design, sample, k_v, drive, late=None):
    """The coupled plant in the cascade, by hand: its map over 5 ms, of [q, v, integrals]; `late`:
    a joint, and by how many periods its samples of the position are late."""
    M, K = matrices(design.robot, design.motion.q[sample])
    zero, one, r = np.zeros((4, 4)), np.eye(4), np.diag(R)
    A = np.block([[zero, one], [-np.linalg.solve(M, K), zero]])
    B = np.vstack([zero, np.linalg.solve(M, r)])
    gains = np.diag(design.gains.kp * R), np.diag(design.gains.ki * R)
    A, B = cascade_map(A, B, np.hstack([zero, one]), gains, T, drive)
    joint, periods = late or (0, 0)
    delayed = np.eye(12 + periods, 12 + periods, -1)
    delayed[:12, :12], delayed[12:13, :12] = A, np.eye(12)[[joint]]
    seen = np.eye(4, 12 + periods)
    if periods:
        seen[joint] = np.eye(12 + periods)[-1]
    delayed[:12] -= B @ np.diag(k_v) @ seen
    return delayed


def damping(z):
    modes = np.log(z.astype(complex))
    return np.min(-modes.real / np.abs(modes))


# --- the position loop of a cascade -------------------------------------------------------------


@pytest.mark.parametrize("drive", DRIVES)
def test_an_axis_in_a_cascade_is_its_map_between_samples(designed, drive):
    """Cut at the samples of the position: margins as python-control tells them of that map."""
    k_v = np.array([3.0, 60.0, 150.0, 20.0])
    design = cascade(designed, k_v.tolist(), drive, "axis_pi")
    response = frequency_response(design, points=1500)
    omega = response.omega
    assert response.at_positions and omega[-1] == pytest.approx(np.pi / T)
    for k, inertia in enumerate(design.i_eff):
        gains = design.gains.kp[[[k]]], design.gains.ki[[[k]]]
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


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize(("k_v", "told"), [(8.25, 0.665), (120.0, 0.115), (400.0, -0.051)])
def test_damping_and_verdict_are_those_of_the_samples(designed, k_v, told, drive):
    """A cascade that would be damped by 0.21 in continuous time; one that runs away."""
    design = cascade(designed, [k_v] * 4, drive)
    response = frequency_response(design, points=50)
    each = [np.linalg.eigvals(closed(design, i, [k_v] * 4, drive)) for i in response.sample]
    np.testing.assert_allclose(response.damping, [damping(z) for z in each], atol=1e-4)
    assert response.damping.min() == pytest.approx(told, abs=0.003)
    assert response.stable.tolist() == [np.abs(z).max() < 1 for z in each] == [told > 0] * 4
    poles = design.linear(int(response.sample[0])).to_control().poles()
    np.testing.assert_allclose(np.sort(np.abs(poles)), np.sort(np.abs(each[0])), atol=1e-6)


@pytest.mark.parametrize("drive", DRIVES)
def test_margins_are_what_the_position_loop_can_lose(designed, drive):
    """Less than the gain margin, and fewer periods than the phase lasts, keep it stable."""
    k_v = np.array([60.0, 50, 40, 30])
    design = cascade(designed, k_v.tolist(), drive)
    response = frequency_response(design, points=1500)
    for k, sample in enumerate(response.sample):
        for share in (0.998, 1.002):
            changed = k_v * np.where(np.arange(4) == k, share * response.gain_margin[k], 1)
            z = np.linalg.eigvals(closed(design, sample, changed, drive))
            assert (np.abs(z).max() > 1) == (share > 1)
        lasts = np.radians(response.phase_margin[k]) / response.crossover[k] / T
        for periods in (int(lasts), int(lasts) + 1):
            z = np.linalg.eigvals(closed(design, sample, k_v, drive, (k, periods)))
            assert (np.abs(z).max() > 1) == (periods > lasts)


@pytest.mark.parametrize(("drive", "k_v"), [(None, 400.0), (0.001, 120.0)])
def test_a_simulated_answer_is_that_of_the_linear_model(designed, k_v, drive):
    """A step of load on joint 2: positions, less those without it, decay or run away as told."""
    design, load = cascade(designed, [k_v] * 4, drive, end=0.2), np.array([0, 300.0, 0, 0])

    def run(load):
        builder = DiagramBuilder()
        loop = builder.AddSystem(sdt.loop(design))
        source = builder.AddSystem(ConstantVectorSource(load))
        builder.Connect(source.get_output_port(), loop.GetInputPort("extra_load_torque"))
        return sdt.simulate(design, builder.Build()).q

    model = design.linear()
    x, expected = np.zeros(len(model.A)), []
    for _ in design.motion.time:
        expected.append(model.C[:4] @ x)
        x = model.A @ x - model.B[:, 12:] @ load  # beside tau_ff
    answer = run(load) - run(0 * load)
    assert np.abs(answer - expected).max() < 0.01 * np.abs(expected).max()


# --- the model in state space -------------------------------------------------------------------

FIELDS = {
    "ideal": {},
    "1 ms": {"drive": Drive(period=0.001)},
    "encoders": {"drive": Drive(period=0.001, encoder_resolution=[1e6] * 4)},
}


@pytest.mark.parametrize("fields", FIELDS)
@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_state_is_reached_and_shown(designed, name, fields):
    """Drake's own inverse dynamics has an integral of the gain 0, which nothing shows."""
    design = designed("coupled_pi", FIELDS[fields] | kind(name), end=0.5)
    model = design.linear(20)
    slow = name in ("p_pi", "inverse_dynamics")
    assert model.period == pytest.approx(T if slow else design.drive.period or 0, rel=1e-8)
    assert model.to_control().dt == model.period
    for A, B in ((model.A, model.B), (model.A.T, model.C.T)):
        for mode in np.linalg.eigvals(A):  # Popov, Belevitch, Hautus: of full rank at every mode
            test = np.hstack([mode * np.eye(len(A)) - A, B])
            for axis in 20 * (1, 0):  # rows and columns in units of their own
                test = test / np.maximum(np.abs(test).max(axis=axis, keepdims=True), 1e-12)
            assert np.linalg.svd(test, compute_uv=False).min() > 1e-6
