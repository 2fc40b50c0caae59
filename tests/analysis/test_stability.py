"""Stability with elastic joints, against characteristic polynomials, expm, and simulation."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from test_linear import (
    OMEGA_R,
    ROTORS,
    R,
    cascade_map,
    held,
    matrices,
    moving,
    two_mass_polynomials,
    two_masses,
)
from variants import kind

from sdt_drake.analysis.stability import least_damping, stability_sweep
from sdt_drake.io.errors import InputError
from sdt_drake.robot.device import Drive
from sdt_drake.run.scenario import load_scenario
from sdt_drake.systems.state_space import StateSpace

ZETA = np.array([0.95, 0.98, 0.99, 0.95])
ENCODERS = ("motor", "link")
SOME = np.array([0.1, 0.3, 0.5, 0.7, 1.0, 1.5])
DRIVE = load_scenario("package://sdt/scenarios/real_device.yaml").drive


@pytest.fixture(scope="module")
def design(designed):
    return designed("coupled_pi")


def damping_of(modes):
    modes = moving(np.asarray(modes))
    return float(np.min(-modes.real / np.abs(modes)))


def polynomial(inertia, k, ratio, encoder, damping_ratio=0.01):
    """Characteristic polynomial of joint k, gains by hand; motor side."""
    speed, below = two_mass_polynomials(ROTORS[k], inertia - ROTORS[k], OMEGA_R, damping_ratio)
    omega_n = ratio * OMEGA_R
    gains = inertia * np.array([2 * ZETA[k] * omega_n, omega_n**2])
    return np.polyadd(np.polymul([1, 0], below), np.polymul(gains, speed[encoder]))


def by_samples(inertia, k, ratio, encoder, drive):
    """The same with a sampled drive: eigenvalues of its map over a period."""
    rotor, omega_n, T = ROTORS[k], ratio * OMEGA_R, drive.period
    kp, ki = 2 * ZETA[k] * omega_n * inertia, omega_n**2 * inertia
    A, B = two_masses(rotor, inertia - rotor, OMEGA_R)
    A, B = held(A, B, T)
    gain = 1.0 if drive.torque_error is None else 1 + drive.torque_error[k]
    # States: of both masses, the integral, and the position at the last sample.
    at = 2 if encoder == "motor" else 0
    speed = np.eye(6)[at + 1]
    if drive.encoder_resolution is not None:
        speed = (np.eye(6)[at] - np.eye(6)[5]) / T
    closed = np.zeros((6, 6))
    closed[:4, :4] = A
    closed[:4] += gain * np.outer(B[:, 0], ki * np.eye(6)[4] - kp * speed)
    closed[4] = np.eye(6)[4] - T * speed
    closed[5, at] = 1
    eigenvalues = np.linalg.eigvals(closed).astype(complex)
    return damping_of(np.log(eigenvalues[np.abs(eigenvalues) > 1e-9]) / T)


# --- against calculations by hand ---------------------------------------------------------------


@pytest.mark.parametrize("encoder", ENCODERS)
@pytest.mark.parametrize(
    "drive",
    [
        Drive(),
        DRIVE,
        Drive(period=0.005, torque_error=[0.1, -0.1, 0, 0.2]),
        Drive(period=0.0005, encoder_resolution=[4096.0] * 4),
    ],
    ids=["ideal", "real_device", "5 ms", "encoders"],
)
def test_damping_is_that_of_the_characteristic_polynomial_or_map(design, encoder, drive):
    """The loop is unstable from where the damping changes its sign, and there has no overshoot."""
    sweep = stability_sweep(design, OMEGA_R, encoder=encoder, drive=drive, ratios=SOME)
    for k, inertia in enumerate(design.inertia.maximum):

        def damping_at(ratio, k=k, inertia=inertia):
            if drive.period:
                return by_samples(inertia, k, ratio, encoder, drive)
            return damping_of(np.roots(polynomial(inertia, k, ratio, encoder)))

        expected = [damping_at(ratio) for ratio in SOME]
        np.testing.assert_allclose(sweep.damping[:, k], expected, atol=1e-6)
        first = unstable_from(damping_at)
        assert sweep.unstable_from[k] == pytest.approx(first, abs=1e-3)
    np.testing.assert_array_equal(np.isnan(sweep.overshoot_percent), sweep.damping <= 0)


@pytest.mark.parametrize("damping_ratio", [0.0, 0.2])
def test_the_springs_damping_counts(design, damping_ratio):
    sweep = stability_sweep(design, OMEGA_R, ratios=[0.3, 1.0], damping_ratio=damping_ratio)
    for k, inertia in enumerate(design.inertia.maximum):
        each = (polynomial(inertia, k, ratio, "motor", damping_ratio) for ratio in (0.3, 1.0))
        expected = [damping_of(np.roots(one)) for one in each]
        np.testing.assert_allclose(sweep.damping[:, k], expected, atol=1e-6)


def unstable_from(damping_at, ratios=SOME):
    """Where the damping first changes its sign, found to 1e-9."""
    first = next((i for i, ratio in enumerate(ratios) if damping_at(ratio) < 0), None)
    if first is None:
        return np.inf
    low, high = (ratios[first - 1] if first else 1e-6), ratios[first]
    while high - low > 1e-9:
        middle = (low + high) / 2
        low, high = (low, middle) if damping_at(middle) < 0 else (middle, high)
    return high


# --- the controller of the scenario -------------------------------------------------------------


def step_of(above, below, ratio):
    """The largest value of the step response of above / below, by partial fractions."""
    t = np.linspace(0, 20 / (ratio * OMEGA_R), 5000)
    poles = np.roots(below)
    residues = np.polyval(above, poles) / (poles * np.polyval(np.polyder(below), poles))
    final = above[-1] / below[-1]
    return (final + (residues * np.exp(poles * t[:, None])).sum(axis=1).real).max()


def cascade(inertia, k, ratio, encoder, k_v):
    """v over v_ref of joint k under P around PI, q_ref its integral: above and below."""
    omega_n = ratio * OMEGA_R
    speed, below = two_mass_polynomials(ROTORS[k], inertia - ROTORS[k], OMEGA_R)
    pi = inertia * np.array([2 * ZETA[k] * omega_n, omega_n**2])
    both = np.polymul(pi, [1, k_v])  # over s²
    closed = np.polyadd(np.polymul([1, 0, 0], below), np.polymul(both, speed[encoder]))
    return np.polymul(both, speed["link"]), closed


def test_the_structure_is_that_of_the_kind(designed, design):
    """pi_id has both gains on the error, whatever the scenario's structure: the same modes, and a
    zero that makes the link overshoot."""
    sweep = stability_sweep(designed("coupled_pi", kind("pi_id")), OMEGA_R, ratios=SOME)
    plain = stability_sweep(design, OMEGA_R, ratios=SOME)
    np.testing.assert_allclose(sweep.damping, plain.damping, rtol=1e-9)
    for i, ratio in enumerate(SOME):
        for k, inertia in enumerate(design.inertia.maximum):
            above, below = cascade(inertia, k, ratio, "motor", 0.0)
            expected = 100 * (step_of(above[:-1], below[:-1], ratio) - 1)
            assert sweep.overshoot_percent[i, k] == pytest.approx(expected, abs=0.02)
    np.testing.assert_allclose(sweep.overshoot_percent[2], 37, atol=0.5)  # at 0.5


def test_scheduled_gains_are_swept_where_they_are_largest(designed, design):
    """There they are those of PI controllers that are tuned to the largest inertia."""
    scheduled = stability_sweep(designed("coupled_pi", kind("pi_scheduled")), OMEGA_R, ratios=SOME)
    plain = stability_sweep(design, OMEGA_R, ratios=SOME)
    np.testing.assert_allclose(scheduled.damping, plain.damping, rtol=1e-9)


@pytest.mark.parametrize(
    ("encoder", "position_gain", "drive"),
    [
        ("motor", None, Drive(period=0.001)),
        ("link", [3.0, 5.0, 7.0, 20.0], Drive(period=0.001)),
        ("link", None, Drive()),
    ],
    ids=["motor-1 ms", "link-own-1 ms", "link-ideal"],
)
def test_the_position_loop_of_a_cascade_is_swept(designed, encoder, position_gain, drive):
    """K_V follows omega_n, or is the scenario's own; positions are sampled every 5 ms."""
    design = designed("coupled_pi", kind("p_pi", position_gain=position_gain))
    sweep = stability_sweep(design, OMEGA_R, encoder=encoder, drive=drive, ratios=SOME)
    for k, inertia in enumerate(design.inertia.maximum):

        def over_a_period(ratio, k=k, inertia=inertia):
            """Map of the closed loop at v_ref = 0, and what a speed that is asked for adds."""
            omega_n = ratio * OMEGA_R
            k_v = omega_n / 4 if position_gain is None else position_gain[k]
            gains = (np.array([[2 * ZETA[k] * omega_n * inertia]]), [[omega_n**2 * inertia]])
            at = 2 if encoder == "motor" else 0
            A, B = two_masses(ROTORS[k], inertia - ROTORS[k], OMEGA_R)
            A, B = cascade_map(A, B, np.eye(4)[[at + 1]], gains, 0.005, drive.period)
            return A - k_v * B * np.eye(5)[at], B[:, 0], k_v

        def damping_at(ratio, over_a_period=over_a_period):
            z = np.linalg.eigvals(over_a_period(ratio)[0]).astype(complex)
            return damping_of(np.log(z) / 0.005)

        for i, ratio in enumerate(SOME):
            assert sweep.damping[i, k] == pytest.approx(damping_at(ratio), abs=1e-6)
            if sweep.damping[i, k] > 0:
                (A, B, k_v), x, speeds = over_a_period(ratio), np.zeros(5), []
                for j in range(2000):
                    speeds.append(x[1])
                    x = A @ x + B * (1 + k_v * 0.005 * j)
                expected = 100 * (max(speeds) - 1)
                assert sweep.overshoot_percent[i, k] == pytest.approx(expected, abs=0.1)
        assert sweep.unstable_from[k] == pytest.approx(unstable_from(damping_at), abs=1e-3)


@pytest.mark.parametrize("encoder", ENCODERS)
def test_feedback_linearisation_is_swept_on_the_coupled_plant(designed, encoder):
    """Joint 2 elastic, the others rigid, the whole state sampled every 5 ms."""
    design = designed("coupled_pi", kind("inverse_dynamics"))
    sweep = stability_sweep(design, OMEGA_R, encoder=encoder, ratios=[0.02, 0.5, 1.3])
    k, T = 1, 0.005
    M, K = matrices(design.robot, design.motion.q[design.torques.d_kk[:, k].argmax()])
    rotor, link = R[k] ** 2 * ROTORS[k], design.torques.d_kk[:, k].max()
    spring, damper = OMEGA_R**2 * link - K[k, k], 0.02 * OMEGA_R * link
    # Coordinates: the four links, and the rotor of joint 2.
    to_rotor = np.eye(5)[k] - np.eye(5)[4]
    inertia, stiffness = np.zeros((5, 5)), np.zeros((5, 5))
    inertia[:4, :4], stiffness[:4, :4] = M, K
    inertia[k, k] -= rotor
    inertia[4, 4] = rotor
    stiffness += spring * np.outer(to_rotor, to_rotor)
    damping = damper * np.outer(to_rotor, to_rotor)
    driven, seen = np.eye(5, 4), np.eye(4, 5)  # the torque of joint 2 acts on its rotor
    driven[[k, 4]] = driven[[4, k]]
    if encoder == "motor":
        seen[k] = np.eye(5)[4]
    A, B = held(
        np.block([
            [np.zeros((5, 5)), np.eye(5)],
            [-np.linalg.solve(inertia, stiffness), -np.linalg.solve(inertia, damping)],
        ]),
        np.vstack([np.zeros((5, 4)), np.linalg.solve(inertia, driven)]),
        T,
    )  # fmt: skip
    for i, ratio in enumerate(sweep.ratio):
        omega_n = ratio * OMEGA_R
        law = np.hstack([(K - M * omega_n**2) @ seen, -M @ np.diag(2 * ZETA * omega_n) @ seen])
        z = np.linalg.eigvals(A + B @ law).astype(complex)
        assert sweep.damping[i, k] == pytest.approx(damping_of(np.log(z) / T), abs=1e-4)
    assert (sweep.damping[:, k] > 0).tolist() == [True, encoder == "link", False]


def test_resting_modes_do_not_count():
    def loop(*poles):
        return StateSpace(np.diag(poles), np.zeros((len(poles), 1)), np.zeros((1, len(poles))), 0)

    assert least_damping(loop(0.0, -2.0, 1e-5), 1.0) == 1
    assert least_damping(loop(0.0, -2.0, 0.1), 1.0) == -1
    assert least_damping(loop(0.0, -2e-4, 1e-5), 1e-4) == -1, "slow loops have slow modes"


# --- bad input ----------------------------------------------------------------------------------


def test_a_robot_without_rotors_is_refused(design):
    robot = dataclasses.replace(design.robot, rotor_inertia=np.zeros(4))
    with pytest.raises(InputError, match="joint 1 has the rotor inertia 0"):
        stability_sweep(dataclasses.replace(design, nominal=robot), OMEGA_R)
