"""Frequency responses and margins, against analytic loops and python-control."""

from __future__ import annotations

import itertools

import control
import numpy as np
import pytest
from hypothesis import given, settings
from strategies import GENERATORS
from test_linear import OMEGA_R, ROTORS, R, matrices, same, two_mass_polynomials
from variants import kind

from sdt_drake.analysis.frequency_response import frequency_response, unwrapped_degrees
from sdt_drake.analysis.linear import linearise
from sdt_drake.robot.device import Drive, Elasticity

STRUCTURES = ("pi", "p_in_feedback")


@pytest.fixture(scope="module")
def damped(designed):
    """The response of axes with the damping ratios ZETA and P in the feedback path."""
    fields = {"plant.i_eff": None, "controller.kp": None, "controller.ki": None}
    fields |= kind("pi", omega_r=OMEGA_R, zeta=ZETA.tolist(), structure="p_in_feedback")
    return frequency_response(designed("axis_pi", fields))


ZETA = np.array([0.2, 0.35, 0.5, 0.65])
OMEGA_N = OMEGA_R / 2


def pi(design, s):
    """Proportional and integral part of each controller, (len(s), n)."""
    s = s[:, None]
    return design.gains.kp + 0 * s, design.gains.ki / s


# --- analytic loops -----------------------------------------------------------------------------


@pytest.mark.parametrize("structure", STRUCTURES)
def test_axis_loop_is_the_analytic_one(designed, structure):
    """Of friction the viscous part counts, b / r² at the motor."""
    friction = {"viscous": [1000.0] * 4, "coulomb": [9000.0] * 4}
    fields = {f"plant.friction.{name}": values for name, values in friction.items()}
    design = designed("axis_pi", fields | {"controller.structure": structure})
    response = frequency_response(design, points=500)
    s = 1j * response.omega
    p, i = pi(design, s)
    inertia = 1 / (design.i_eff * s[:, None] + 1000 / R**2)
    gain = (p + i) * inertia

    np.testing.assert_allclose(response.loop_gain, gain, rtol=1e-8)
    ahead = p + i if structure == "pi" else i
    np.testing.assert_allclose(response.tracking, ahead * inertia / (1 + gain), rtol=1e-8)
    np.testing.assert_allclose(response.modulus_margin, np.abs(1 + gain).min(axis=0), rtol=1e-8)
    assert response.stable.all()


def test_numbers_of_the_second_order_loop(damped):
    """Bandwidth, peak, damping, and no gain margin: its phase never reaches -180 deg."""
    np.testing.assert_allclose(damped.damping, ZETA, rtol=1e-6)
    assert np.isinf(damped.gain_margin).all() and not damped.gain_reduction.any()
    a = 1 - 2 * ZETA**2
    expected = OMEGA_N * np.sqrt(a + np.sqrt(a**2 + 1))
    np.testing.assert_allclose(damped.bandwidth, expected, rtol=1e-5)
    peak = 1 / (2 * ZETA * np.sqrt(1 - ZETA**2))
    np.testing.assert_allclose(damped.peak_db, 20 * np.log10(peak), atol=1e-4)
    np.testing.assert_allclose(damped.peak_omega, OMEGA_N * np.sqrt(a), rtol=3e-3)


# --- python-control -----------------------------------------------------------------------------


@pytest.mark.parametrize("elastic", [False, True])
def test_margins_are_those_of_python_control(designed, elastic):
    """With a resonance the loop gain crosses 1 again: the worst crossing counts."""
    drive = Drive(torque_bandwidth=None if elastic else 20.0)
    fields = {"plant.elasticity": Elasticity([OMEGA_R] * 4, 0.002, "link")} if elastic else {}
    design = designed("axis_pi", fields | {"drive": drive})
    response = frequency_response(design, points=3000)
    for k, inertia in enumerate(design.i_eff[:2]):
        above, below = [1.0], np.polymul([inertia, 0], [1 / (2 * np.pi * 20), 1])
        if elastic:
            speed, below = two_mass_polynomials(ROTORS[k], inertia - ROTORS[k], OMEGA_R, 0.002)
            above = speed["link"]
        pi = control.tf([design.gains.kp[k], design.gains.ki[k]], [1, 0])
        loop = pi * control.tf(above, below)
        _, margins, _, _, crossings, _ = control.stability_margins(loop, returnall=True)
        same(response.loop_gain[:, k], loop(1j * response.omega), 1e-6)
        assert response.crossover[k] == pytest.approx(max(crossings), rel=1e-4)
        assert response.phase_margin[k] == pytest.approx(np.abs(margins).min(), abs=0.1)


# --- sampled drives -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("structure", "bandwidth", "resolution"),
    [("pi", 100.0, None), ("p_in_feedback", None, [4096.0] * 4)],
)
def test_sampled_loop_is_the_z_transfer_function(designed, structure, bandwidth, resolution):
    """With encoders, speeds are differences of positions."""
    period = 0.001
    drive = Drive(period=period, torque_bandwidth=bandwidth, encoder_resolution=resolution)
    design = designed("axis_pi", {"drive": drive, "controller.structure": structure})
    response = frequency_response(design, points=300)
    z = np.exp(1j * response.omega * period)[:, None]
    # 1 / s behind a hold, with the lag: T / (z - 1) - tau (1 - a) / (z - a).
    measured = speed = period / (z - 1)
    if bandwidth:
        tau = 1 / (2 * np.pi * bandwidth)
        a = np.exp(-period / tau)
        measured = speed = speed - tau * (1 - a) / (z - a)
    if resolution:  # of 1 / s² behind a hold
        measured = period**2 * (z + 1) / (2 * (z - 1) ** 2) * (1 - 1 / z) / period
    integral = design.gains.ki * period / (z - 1)  # x+ = x + T e
    both = design.gains.kp + integral
    gain = both * measured / design.i_eff
    ahead = both if structure == "pi" else integral
    expected = ahead * speed / design.i_eff / (1 + gain)  # the link's true speed
    np.testing.assert_allclose(response.loop_gain, gain, rtol=1e-6, atol=1e-10)  # of 1e6
    np.testing.assert_allclose(response.tracking, expected, rtol=1e-6, atol=1e-12)


def test_too_slow_a_drive_is_unstable(designed):
    # (z - 1)² + a (z - 1) + b: z = -1 is reached at a = 2 + b / 2, with a = K_PS T / I.
    inertia, T, b = 100.0, 0.005, 0.1
    kp = np.array([0.98, 1.02, 0.98, 1.02]) * (2 + b / 2) * inertia / T
    gains = {"kp": kp.tolist(), "ki": [b * inertia / T**2] * 4, "omega_r": None, "zeta": None}
    fields = {"plant.i_eff": [inertia] * 4, "drive": Drive(period=T)} | kind("pi", **gains)

    response = frequency_response(designed("axis_pi", fields), points=30)
    assert response.stable.tolist() == [True, False, True, False]


def fastest_growth(loop, k, factor):
    """Of all modes of a loop, the gain of joint k changed: the largest |z| - 1, or real part."""
    opened, n = loop.opened, loop.n
    back = opened.C[:n] if loop.at_positions else opened.C[4 * n :]
    modes = np.linalg.eigvals(
        opened.A + opened.B[:, :n] * np.where(np.arange(n) == k, factor, 1) @ back
    )
    return np.abs(modes).max() - 1 if opened.period else modes.real.max()


@pytest.mark.parametrize(
    "fields",
    [
        {"drive": Drive(period=0.001, encoder_resolution=[2.0**22] * 4)},
        kind("inverse_dynamics"),
        kind("p_pi") | {"drive": Drive(period=0.001)},
        {"plant.elasticity": Elasticity([300.0] * 4, 0.05, "link")},
    ],
)
def test_gain_margins_are_where_a_mode_comes_to_its_stability_limit(designed, fields):
    design = designed("coupled_pi", fields)
    response = frequency_response(design, points=700)
    for k in range(4):
        loop = linearise(design, int(response.sample[k]))
        factor = response.gain_margin[k]
        if np.isinf(factor):  # of the springs alone, joints 3 and 4
            assert "plant.elasticity" in fields and k >= 2
            continue
        outwards = np.sign(factor - 1) * 0.002
        assert fastest_growth(loop, k, factor * (1 - outwards)) < 1e-9
        assert fastest_growth(loop, k, factor * (1 + outwards)) > 1e-4


def test_less_gain_does_not_hold_what_gravity_overturns(designed):
    """The limit is at a standstill: no oscillation, which the angle of the gain would show."""
    design, sample = designed("coupled_pi", kind("pi", omega_r=10.0)), 4000
    factor = frequency_response(design, sample=sample).gain_reduction
    loop = linearise(design, sample)
    assert np.all(factor[[0, 3]] == 0) and 0.5 < factor[1] < 0.8
    for k in (1, 2):
        assert fastest_growth(loop, k, 1.02 * factor[k]) < 1e-9
        assert fastest_growth(loop, k, 0.98 * factor[k]) > 1e-4


# --- the coupled plant --------------------------------------------------------------------------


def test_each_joint_is_judged_at_its_largest_inertia_with_the_other_loops_closed(designed):
    design = designed("coupled_pi")
    response = frequency_response(design, points=60)
    s = 1j * response.omega
    per_speed = (design.gains.kp + design.gains.ki / s[:, None]) * R**2  # joint side
    for k, sample in enumerate(response.sample):
        assert design.torques.d_kk[sample, k] == pytest.approx(design.torques.d_kk[:, k].max())
        M, K = matrices(design.robot, design.motion.q[sample])
        closed = per_speed * (np.arange(4) != k)
        A = M * s[:, None, None] ** 2 + K + s[:, None, None] * np.eye(4) * closed[:, None, :]
        v = s * np.linalg.inv(A)[:, k, k]
        np.testing.assert_allclose(response.loop_gain[:, k], per_speed[:, k] * v, rtol=1e-5)


# --- edges --------------------------------------------------------------------------------------


def test_no_crossover_is_nan(designed):
    weak = Drive(torque_error=[-1 + 1e-8, 0, 0, 0])
    response = frequency_response(designed("axis_pi", {"drive": weak}), points=300)
    for name in ("crossover", "phase_margin", "bandwidth"):
        assert np.isnan(getattr(response, name)).tolist() == [True, False, False, False], name


@settings(max_examples=10)
@given(GENERATORS)
def test_unwrapped_phase_has_no_jumps_and_is_that_of_the_response(rng):
    """At the last crossover, or the end if there is none, it lies between -270 and 90 deg."""
    omega = np.geomspace(0.01, 100, 2000)
    s = 1j * omega[:, None]
    zeros, poles = rng.uniform(0.05, 20, (2, 3, 6))
    factors = (s + zeros[:, None]) / (s + poles[:, None]) / s ** rng.integers(0, 2, (3, 1, 1))
    response = np.prod(factors, axis=0) * rng.choice([-1, 1], 6) * 10 ** rng.uniform(-9, 1, 6)
    for at_crossover in (False, True):
        phase = unwrapped_degrees(response, at_crossover=at_crossover)
        assert np.abs(np.diff(phase, axis=0)).max() < 5
        np.testing.assert_allclose(np.exp(1j * np.radians(phase)), response / np.abs(response))
    above = [np.flatnonzero(np.abs(x) >= 1) for x in response.T]
    last = [i[-1] if len(i) else -1 for i in above]
    assert np.all(np.abs(phase[last, range(6)] + 90) <= 180 + 1e-9)
    assert np.all(np.abs(unwrapped_degrees(response)[0]) <= 180 + 1e-9)


def test_written_responses_read_back(damped, tmp_path):
    damped.results("").write(tmp_path / "bode.csv")
    columns = np.genfromtxt(tmp_path / "bode.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(columns["omega"], damped.omega)
    for name, k in itertools.product(("tracking", "loop_gain"), range(4)):
        phase = np.radians(columns[f"{name}_phase_{k + 1}"])
        back = columns[f"{name}_magnitude_{k + 1}"] * np.exp(1j * phase)
        np.testing.assert_allclose(back, getattr(damped, name)[:, k], rtol=1e-12)
    assert len(columns.dtype) == 17
