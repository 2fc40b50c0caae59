"""Linearised loops, against matrices by hand."""

import numpy as np
import pytest
from helpers.variants import kind
from oracles.by_hand import GEAR
from oracles.two_mass import held

from sdt_drake.analysis.frequency_response import frequency_response
from sdt_drake.analysis.linear import linearise
from sdt_drake.analysis.stability import least_damping
from sdt_drake.systems.state_space import StateSpace

OMEGA_R = 65.991
SAMPLES = (1000, 4776)  # at the last, joint 3 holds the most against gravity


# --- processes ----------------------------------------------------------------------------------


def matrices(robot, q, v):
    """Inertia with motors, and change of the steady torque with q and v, from the plant itself."""
    plant = robot.make_plant()
    context = plant.CreateDefaultContext()

    def steady_torque(at):
        plant.SetPositionsAndVelocities(context, at)
        return plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context)

    h, x = 1e-5, np.append(q, v)
    change = [steady_torque(x + h * e) - steady_torque(x - h * e) for e in np.eye(len(x))]
    plant.SetPositionsAndVelocities(context, x)
    return plant.CalcMassMatrix(context), *np.hsplit(np.transpose(change) / (2 * h), 2)


def test_each_joint_is_judged_at_its_largest_inertia_with_the_other_loops_closed(designed):
    """v = s (M s² + K + s (D + C))^-1 tau, of the mass matrix M, and what the steady torque changes
    with q and v: K and D."""
    design = designed("coupled_pi")
    response = frequency_response(design, points=60)
    s, gains = 1j * response.omega, design.tuning.gains
    per_speed = (gains.kp + gains.ki / s[:, None]) * GEAR**2  # joint side
    for k, sample in enumerate(response.sample):
        inertia = design.torques.d_kk[:, k]
        assert inertia[sample] == pytest.approx(inertia.max(), rel=1e-9)
        motion = design.reference.tracked
        M, K, D = matrices(design.device.simulated, motion.q[sample], motion.v[sample])
        others = np.eye(4) * (per_speed * (np.arange(4) != k))[:, None, :]
        A = M * s[:, None, None] ** 2 + K + s[:, None, None] * (D + others)
        v = s * np.linalg.inv(A)[:, k, k]
        np.testing.assert_allclose(response.loop_gain[:, k], per_speed[:, k] * v, rtol=1e-5)


# --- inverse dynamics ------------------------------------------------------------------------


def linearised_feedback(design, sample, zeta, T, moving):
    """The coupled plant under M (2 zeta omega_n (v_ref - v) + omega_n² (q_ref - q)) + K q + D v, as
    a sampled and held law: its map of [q, v] over a period, and what q_ref and v_ref add."""
    motion = design.reference.tracked
    M, K, D = matrices(design.device.simulated, motion.q[sample], moving * motion.v[sample])
    omega_n, one, zero = OMEGA_R / 2, np.eye(4), np.zeros((4, 4))
    A = np.block([[zero, one], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
    A, B = held(A, np.vstack([zero, np.linalg.inv(M)]), T)
    kp, kd = M * omega_n**2, M @ np.diag(2 * np.array(zeta) * omega_n)
    return A + B @ np.hstack([K - kp, D - kd]), B @ kp, B @ kd


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("sample", SAMPLES)
def test_inverse_dynamics_decouples_coupled_plant(designed, sample, moving):
    """Every joint follows as if alone, sampled with the reference, and no other moves."""
    design = designed("coupled_pi", kind("inverse_dynamics"))
    loop, T = linearise(design, sample, at_rest=not moving), 0.005
    zeta = np.array([0.95, 0.98, 0.99, 0.95])
    A, from_q, from_v = linearised_feedback(design, sample, zeta, T, moving)
    omega = np.geomspace(0.1, np.pi / T, 40)
    speed = np.empty((40, 4, 4), dtype=complex)
    for i, z in enumerate(np.exp(1j * omega * T)):
        state = np.linalg.solve(z * np.eye(8) - A, from_q * T / (z - 1) + from_v)
        speed[i] = state[4:]
    for k in range(4):
        alone = speed[:, k, k]
        np.testing.assert_allclose(loop.closed(k).response(omega)[:, 0, 0], alone, atol=1e-5)
        assert f"q_ref_{k + 1}" in loop.closed(k).states
        s, error = 1j * omega[:20], 2 * zeta[k] * OMEGA_R / 2
        slow = (error * s + OMEGA_R**2 / 4) / (s**2 + error * s + OMEGA_R**2 / 4)
        np.testing.assert_allclose(alone[:20], slow, atol=0.05)
    others = speed * (1 - np.eye(4))
    assert np.abs(others).max() < (0.04 if moving else 1e-3)  # loads change within a period
    assert loop.opened.period == T
    if moving:
        return  # joints share their modes by these loads

    double = held(np.array([[0.0, 1], [0, 0]]), np.array([[0.0], [1]]), T)
    expected = []
    for k in range(4):
        gains = np.array([[OMEGA_R**2 / 4, zeta[k] * OMEGA_R]])
        modes = np.log(np.linalg.eigvals(double[0] - double[1] @ gains).astype(complex))
        expected.append(np.min(-modes.real / np.abs(modes)))
    assert expected[0] < 0.99 < 1 == expected[1] == expected[2]  # no joint has that of another
    damping = frequency_response(design, sample=sample, points=50, at_rest=True).damping
    np.testing.assert_allclose(damping, expected, atol=1e-6)


# --- modes that are gone after a sample ---------------------------------------------------------


@pytest.mark.parametrize(
    ("eigenvalues", "damping"),
    [((0.0,), 1.0), ((0.0, 0.0, 0.0), 1.0), ((0.0, 0.5), 1.0), ((0.0, -1.2), -0.057937)],
)
def test_deadbeat_mode_has_a_damping_and_hides_no_other(eigenvalues, damping):
    n = len(eigenvalues)
    A = np.diag(eigenvalues) + np.diag(np.ones(n - 1), 1)  # 0 three times: one Jordan block
    turned = np.linalg.qr(np.random.default_rng(1).normal(size=(n, n)))[0]
    rest = np.ones((n, 1)), np.ones((1, n)), np.zeros((1, 1))
    for system in (StateSpace(A, *rest, 0.001), StateSpace(turned @ A @ turned.T, *rest, 0.001)):
        for modes in (system.modes(), system.modes_between()):
            assert least_damping(modes, 30.0) == pytest.approx(damping, abs=1e-6)


def test_loop_is_linear_at_the_start_of_the_motion_by_default(design):
    default, start, end = (linearise(design, *at).closed() for at in ((), (0,), (SAMPLES[1],)))
    np.testing.assert_array_equal(default.A, start.A)
    assert not np.array_equal(end.A, start.A)
