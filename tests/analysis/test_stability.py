"""Stability with elastic joints, against characteristic polynomials, expm, and simulation."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from test_linear import (
    OMEGA_R,
    ROTORS,
    cascade_map,
    moving,
    two_mass_polynomials,
    two_masses,
)
from variants import kind

from sdt_drake.analysis.stability import least_damping, stability_sweep
from sdt_drake.io.errors import InputError
from sdt_drake.robot.device import Drive
from sdt_drake.systems.state_space import StateSpace

ZETA = np.array([0.95, 0.98, 0.99, 0.95])
ENCODERS = ("motor", "link")
SOME = np.array([0.1, 0.3, 0.5, 0.7, 1.0, 1.5])


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
    """The same with a sampled drive: modes of its map over a period."""
    at, omega_n = 3 if encoder == "motor" else 1, ratio * OMEGA_R
    gain = inertia * (1 + drive.torque_error[k])
    gains = [[2 * ZETA[k] * omega_n * gain]], [[omega_n**2 * gain]]
    masses = two_masses(ROTORS[k], inertia - ROTORS[k], OMEGA_R)
    closed, _ = cascade_map(*masses, np.eye(4)[[at]], np.array(gains), drive.period, drive.period)
    return damping_of(np.log(np.linalg.eigvals(closed).astype(complex)) / drive.period)


# --- against calculations by hand ---------------------------------------------------------------


@pytest.mark.parametrize("encoder", ENCODERS)
@pytest.mark.parametrize(
    ("drive", "damping_ratio"),
    [(Drive(), 0.2), (Drive(period=0.005, torque_error=[0.1, -0.1, 0, 0.2]), 0.01)],
    ids=["ideal", "5 ms"],
)
def test_damping_is_that_of_the_characteristic_polynomial_or_map(
    design, encoder, drive, damping_ratio
):
    """The loop is unstable from where the damping changes its sign, and there has no overshoot."""
    sweep = stability_sweep(
        design, OMEGA_R, encoder=encoder, drive=drive, ratios=SOME, damping_ratio=damping_ratio
    )
    for k, inertia in enumerate(design.inertia.maximum):

        def damping_at(ratio, k=k, inertia=inertia):
            if drive.period:
                return by_samples(inertia, k, ratio, encoder, drive)
            return damping_of(np.roots(polynomial(inertia, k, ratio, encoder, damping_ratio)))

        expected = [damping_at(ratio) for ratio in SOME]
        np.testing.assert_allclose(sweep.damping[:, k], expected, atol=1e-6)
        if min(expected) < 0 < expected[0]:
            assert sweep.unstable_from[k] == pytest.approx(unstable_from(damping_at), abs=1e-3)
    np.testing.assert_array_equal(np.isnan(sweep.overshoot_percent), sweep.damping <= 0)


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


@pytest.mark.parametrize(("controller", "overshoot"), [("pi_id", 37), ("pi_scheduled", None)])
def test_other_controllers_of_speed_have_the_modes_of_pi(designed, design, controller, overshoot):
    """pi_id has both gains on the error, hence a zero; pi_scheduled its largest gains, as pi."""
    sweep = stability_sweep(designed("coupled_pi", kind(controller)), OMEGA_R, ratios=SOME)
    plain = stability_sweep(design, OMEGA_R, ratios=SOME)
    np.testing.assert_allclose(sweep.damping, plain.damping, rtol=1e-9)
    expected = plain.overshoot_percent[2] if overshoot is None else [overshoot] * 4  # at 0.5
    np.testing.assert_allclose(sweep.overshoot_percent[2], expected, atol=0.5)


@pytest.mark.parametrize(
    ("encoder", "position_gain", "drive"),
    [
        ("motor", [3.0, 5.0, 7.0, 20.0], Drive(period=0.001)),
        ("link", None, Drive()),
    ],
    ids=["motor-own-1 ms", "link-ideal"],
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
