"""Margins of coupled loops, and phases without jumps; other numbers are those of random loops."""

import itertools

import numpy as np
import pytest
from by_hand import GEAR, ROTORS
from hypothesis import given, settings
from strategies import GENERATORS
from test_linear import OMEGA_R, matrices
from variants import kind

from sdt_drake.analysis.frequency_response import frequency_response, unwrapped_degrees
from sdt_drake.analysis.linear import linearise
from sdt_drake.robot.device import Drive, Elasticity


def fastest_growth(loop, k, factor):
    """Of all modes of a loop, the gain of joint k changed: the largest |z| - 1, or real part."""
    opened, n = loop.opened, loop.n
    back = opened.C[:n] if loop.at_positions else opened.C[4 * n :]
    modes = np.linalg.eigvals(
        opened.A + opened.B[:, :n] * np.where(np.arange(n) == k, factor, 1) @ back
    )
    return np.abs(modes).max() - 1 if opened.period else modes.real.max()


@pytest.mark.parametrize(
    ("fields", "sample", "limited"),
    [
        ({"drive": Drive(period=0.001, encoder_resolution=[2.0**22] * 4)}, None, 4),
        (kind("inverse_dynamics"), None, 4),
        (kind("p_pi") | {"drive": Drive(period=0.001)}, None, 4),
        # Less gain does not hold what gravity overturns; the limit is no oscillation.
        (kind("pi", omega_r=10.0), 4000, 2),
    ],
)
def test_margins_are_where_a_mode_comes_to_its_stability_limit(designed, fields, sample, limited):
    design = designed("coupled_pi", fields)
    response = frequency_response(design, sample=sample, points=700)
    factors = response.gain_margin if sample is None else response.gain_reduction
    found = np.flatnonzero(np.isfinite(factors) & (factors > 0))
    assert len(found) == limited
    for k in found:
        loop, outwards = linearise(design, int(response.sample[k])), np.sign(factors[k] - 1)
        assert fastest_growth(loop, k, factors[k] * (1 - 0.01 * outwards)) < 1e-9
        assert fastest_growth(loop, k, factors[k] * (1 + 0.01 * outwards)) > 1e-4


@pytest.mark.parametrize("encoder", ["motor", "link"])
def test_each_joint_is_judged_where_its_inertia_is_largest_with_the_others_closed(
    designed, encoder
):
    """On elastic joints, whose links gravity swings."""
    springs = Elasticity([OMEGA_R] * 4, 0.02, encoder)
    design = designed("coupled_pi", {"plant.elasticity": springs})
    response = frequency_response(design, points=60)
    s = 1j * response.omega[:, None, None]
    spring, damper = np.diag(design.springs.stiffness), np.diag(design.springs.damping)
    rotors, joint = np.diag(GEAR**2 * ROTORS), spring + s * damper
    feedback = (design.gains.kp + design.gains.ki / s[:, 0]) * GEAR**2  # joint side
    for k, sample in enumerate(response.sample):
        assert design.torques.d_kk[sample, k] == pytest.approx(design.torques.d_kk[:, k].max())
        M, K = matrices(design.robot, design.motion.q[sample])
        moved = np.block(
            [[(M - rotors) * s**2 + K + joint, -joint], [-joint, rotors * s**2 + joint]]
        )
        at = slice(4, 8) if encoder == "motor" else slice(4)
        moved[:, 4:, at] += s * np.eye(4) * (feedback * (np.arange(4) != k))[:, None, :]
        v = s[:, 0, 0] * np.linalg.inv(moved)[:, at, 4:][:, k, k]
        np.testing.assert_allclose(response.loop_gain[:, k], feedback[:, k] * v, rtol=1e-5)


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


def test_written_responses_read_back(designed, tmp_path):
    response = frequency_response(designed("axis_pi"), points=100)
    response.results("").write(tmp_path / "bode.csv")
    columns = np.genfromtxt(tmp_path / "bode.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(columns["omega"], response.omega)
    for name, k in itertools.product(("tracking", "loop_gain"), range(4)):
        phase = np.radians(columns[f"{name}_phase_{k + 1}"])
        back = columns[f"{name}_magnitude_{k + 1}"] * np.exp(1j * phase)
        np.testing.assert_allclose(back, getattr(response, name)[:, k], rtol=1e-12)
