"""Margins of coupled loops, and phases without jumps; other numbers are those of random loops."""

import numpy as np
import pytest
from variants import kind

from sdt_drake.analysis.frequency_response import frequency_response
from sdt_drake.analysis.linear import linearise
from sdt_drake.robot.device import Drive


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
