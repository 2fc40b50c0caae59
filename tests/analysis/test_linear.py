"""Linearised loops, against matrices and polynomials by hand."""

from __future__ import annotations

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from strategies import GENERATORS
from variants import kind

from sdt_drake.analysis.linear import linear_process, linearise
from sdt_drake.robot.device import Drive, Elasticity
from sdt_drake.systems.state_space import StateSpace

OMEGA_R = 65.991
OMEGA = np.geomspace(0.1, 2000, 60)
SAMPLES = (1000, 4776)  # at the last, joint 3 holds the most against gravity
R = np.array([67.2, 1, 1, 1])
ROTORS = np.array([0.1291, 1.73, 0.531, 0.531])  # kg m², motor side


# --- shared with the other tests of this folder -------------------------------------------------


def held(A, B, period):
    """The map of x' = A x + B u over a period with u held."""
    n, m = B.shape
    both = expm(period * np.block([[A, B], [np.zeros((m, n + m))]]))
    return both[:n, :n], both[:n, n:]


def two_masses(rotor, link, omega_r, damping_ratio=0.01):
    """Of an elastic axis, motor side: A and B of [q, v, theta, w]' and of the torque."""
    k, c = omega_r**2 * link, 2 * damping_ratio * omega_r * link
    A = np.zeros((4, 4))
    A[0, 1] = A[2, 3] = 1
    A[1] = np.array([-k, -c, k, c]) / link
    A[3] = np.array([k, c, -k, -c]) / rotor
    return A, np.array([[0], [0], [0], [1 / rotor]])


def two_mass_polynomials(rotor, link, omega_r, damping_ratio=0.01):
    """Of an elastic axis, motor side: speeds of motor and link over the torque, and what both are
    divided by."""
    k, c = omega_r**2 * link, 2 * damping_ratio * omega_r * link
    below = np.polyadd([rotor * link, 0, 0, 0], np.polymul([(rotor + link), 0], [c, k]))
    return {"motor": np.array([link, c, k]), "link": np.array([c, k])}, below


def cascade_map(A, B, seen, gains, period, drive=None):
    """PI speed loops with both gains on the error around x' = A x + B tau: the map of [x, integral]
    over a period, and what adds the speed that is asked for, held; sampled every `drive` [s].

    `seen` is the measured speed in x; gains are (kp, ki), matrices of the torque over the speed.
    """
    (kp, ki), n, m = gains, *B.shape
    if drive is None:
        one = np.block([[A - B @ kp @ seen, B @ ki], [-seen, np.zeros((m, m))]])
        return held(one, np.vstack([B @ kp, np.eye(m)]), period)
    a, b = held(A, B, drive)
    one = np.block([[a - b @ kp @ seen, b @ ki], [-drive * seen, np.eye(m)]])
    into = np.vstack([b @ kp, drive * np.eye(m)])
    whole, added = np.eye(n + m), np.zeros((n + m, m))
    for _ in range(round(period / drive)):
        whole, added = one @ whole, one @ added + into
    return whole, added


def moving(modes, least=1e-4):
    """Modes apart from those at rest."""
    return modes[np.abs(modes) > least]


def same_modes(actual, expected, tolerance=1e-6):
    """The same numbers in any order, to a share of their size."""
    actual, expected = list(actual), list(expected)
    assert len(actual) == len(expected), (actual, expected)
    for mode in expected:
        near = min(range(len(actual)), key=lambda i, mode=mode: abs(actual[i] - mode))
        assert abs(actual.pop(near) - mode) < tolerance * abs(mode), mode


def same(actual, expected, tolerance=1e-9):
    """Equal to a share of the largest value."""
    scale = np.abs(expected).max()
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale)


# --- state space --------------------------------------------------------------------------------


@settings(max_examples=10)
@given(GENERATORS, st.integers(1, 5), st.floats(0.01, 0.5))
def test_state_space_is_that_of_python_control(rng, n, period):
    """Random stable systems: response, step, zero-order hold and modes."""
    A = rng.normal(size=(n, n))
    A = A - (np.linalg.eigvals(A).real.max() + 0.2) * np.eye(n)
    B, C, D = rng.normal(size=(n, 2)), rng.normal(size=(3, n)), rng.normal(size=(3, 2))
    ours, theirs = StateSpace(A, B, C, D), control.ss(A, B, C, D)
    for own, other in (
        (ours, theirs),
        (ours.sampled(period), control.sample_system(theirs, period, "zoh")),
    ):
        omega = np.geomspace(0.1, 0.99 * np.pi / period, 20)
        expected = np.moveaxis(other.frequency_response(omega).complex, -1, 0)
        np.testing.assert_allclose(own.response(omega), expected, rtol=1e-7, atol=1e-9)
        same_modes(own.modes(), np.linalg.eigvals(A), 1e-5)
    one = StateSpace(A, B[:, :1], C[:1], D[:1, :1])
    for own, steps, every in ((one, 60, 1), (one.sampled(period), 300, 5)):
        t, y = own.step(steps * (own.period or 0.05), 60)
        at = np.linspace(0, t[-1], steps + 1)
        system = control.ss(own.A, own.B, own.C, own.D, own.period or 0)
        expected = control.forced_response(system, at, 1 + 0 * at).outputs
        np.testing.assert_allclose(t, at[::every], atol=1e-9)
        np.testing.assert_allclose(y[:, 0], expected[::every], atol=1e-7)


# --- processes ----------------------------------------------------------------------------------


def matrices(robot, q):
    """Inertia with motors, and change of the gravity torque with q, from the plant itself."""
    plant = robot.make_plant()
    context = plant.CreateDefaultContext()

    def gravity(at):
        plant.SetPositions(context, at)
        return -plant.CalcGravityGeneralizedForces(context)

    h = 1e-5
    stiffness = [(gravity(q + h * e) - gravity(q - h * e)) / (2 * h) for e in np.eye(len(q))]
    plant.SetPositions(context, q)
    return plant.CalcMassMatrix(context), np.transpose(stiffness)


@pytest.mark.parametrize("encoder", ["motor", "link"])
@pytest.mark.parametrize("sample", SAMPLES)
def test_coupled_process_with_elastic_joints(designed, sample, encoder):
    design = designed("coupled_pi", {"plant.elasticity": Elasticity([OMEGA_R] * 4, 0.02, encoder)})
    M, K = matrices(design.robot, design.motion.q[sample])
    rotors = np.diag(R**2 * ROTORS)
    spring = np.diag(design.springs.stiffness)
    damper = np.diag(design.springs.damping)
    s = 1j * OMEGA[:, None, None]
    joint = spring + s * damper
    both = np.block([[(M - rotors) * s**2 + K + joint, -joint], [-joint, rotors * s**2 + joint]])
    q = np.linalg.solve(both, np.vstack([np.zeros((4, 4)), np.diag(R)]) + 0j)
    P = linear_process(design, sample).response(OMEGA)

    same(P[:, 8:12], q[:, :4], 1e-6)
    same(P[:, :4], q[:, 4:] if encoder == "motor" else q[:, :4], 1e-6)


# --- modes of closed loops ----------------------------------------------------------------------


def all_modes(loop):
    """Of the loops of all joints, which share none: the axes are decoupled."""
    return np.concatenate([loop.closed(k).modes() for k in range(loop.n)])


def test_modes_are_the_roots_of_the_polynomial(designed):
    error = np.array([0.02, -0.02, 0, 0.01])
    drive = Drive(torque_bandwidth=30.0, torque_error=error.tolist())
    design = designed("axis_pi", {"drive": drive})
    lag = 1 / (2 * np.pi * 30)
    expected = [
        np.roots([inertia * lag, inertia, (1 + e) * kp, (1 + e) * ki])
        for inertia, kp, ki, e in zip(
            design.i_eff, design.gains.kp, design.gains.ki, error, strict=True
        )
    ]
    modes = all_modes(linearise(design))

    same_modes(moving(modes), np.concatenate(expected))
    assert len(modes) == 12  # none of the positions, which nothing feeds back


def linearised_feedback(design, sample, zeta, T):
    """The coupled plant under M (2 zeta omega_n (v_ref - v) + omega_n² (q_ref - q)) + K q, all of
    it sampled and held: its map of [q, v] over a period, and what q_ref and v_ref add."""
    M, K = matrices(design.robot, design.motion.q[sample])
    omega_n, one, zero = OMEGA_R / 2, np.eye(4), np.zeros((4, 4))
    A, B = held(
        np.block([[zero, one], [-np.linalg.solve(M, K), zero]]),
        np.vstack([zero, np.linalg.inv(M)]),
        T,
    )
    kp, kd = M * omega_n**2, M @ np.diag(2 * np.array(zeta) * omega_n)
    return A + B @ np.hstack([K - kp, -kd]), B @ kp, B @ kd


@pytest.mark.parametrize("sample", SAMPLES)
def test_inverse_dynamics_decouples_the_coupled_plant(designed, sample):
    """Every joint follows as if alone, sampled with the reference, and no other moves."""
    design = designed("coupled_pi", kind("inverse_dynamics"))
    loop, T, zeta = linearise(design, sample), 0.005, np.array([0.95, 0.98, 0.99, 0.95])
    A, from_q, from_v = linearised_feedback(design, sample, zeta, T)
    omega = np.geomspace(0.1, np.pi / T, 40)
    speed = np.empty((40, 4, 4), dtype=complex)
    for i, z in enumerate(np.exp(1j * omega * T)):
        state = np.linalg.solve(z * np.eye(8) - A, from_q * T / (z - 1) + from_v)
        speed[i] = state[4:]
    for k in range(4):
        alone = speed[:, k, k]
        np.testing.assert_allclose(loop.closed(k).response(omega)[:, 0, 0], alone, atol=1e-5)
        s, error = 1j * omega[:20], 2 * zeta[k] * OMEGA_R / 2
        slow = (error * s + OMEGA_R**2 / 4) / (s**2 + error * s + OMEGA_R**2 / 4)
        np.testing.assert_allclose(alone[:20], slow, atol=0.05)
    others = speed * (1 - np.eye(4))
    assert np.abs(others).max() < 1e-3  # gravity changes within a period
    assert loop.opened.period == T
