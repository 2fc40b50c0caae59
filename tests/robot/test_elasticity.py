"""Springs of elastic joints against their formula, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.robot.device import Elasticity, springs_of

OMEGA = [60.0, 0.0, 150.0, 30.0]  # rad/s
INERTIA = np.array([18000.0, 90.0, 790.0, 250.0])  # kg m²
GRAVITY = np.array([0.0, 500.0, 900.0, -300.0])  # N m/rad


def test_spring_and_gravity_swing_the_link_at_the_given_frequency():
    """d x'' + c x' + (k + k_g) x = 0 has the roots of omega and zeta."""
    springs = springs_of(Elasticity(OMEGA, damping_ratio=0.2), INERTIA, GRAVITY)
    for k in (0, 2, 3):
        stiffness = springs.stiffness[k] + GRAVITY[k]
        roots = np.roots([INERTIA[k], springs.damping[k], stiffness])
        np.testing.assert_allclose(np.abs(roots), OMEGA[k], rtol=1e-12)
        np.testing.assert_allclose(-roots.real / np.abs(roots), 0.2, rtol=1e-12)


def test_a_little_damping_and_the_motor_encoder_by_default():
    elasticity = Elasticity(OMEGA)
    assert (elasticity.damping_ratio, elasticity.encoder) == (0.01, "motor")
    springs = springs_of(elasticity, INERTIA, GRAVITY)
    np.testing.assert_allclose(springs.damping, 0.02 * INERTIA * OMEGA, rtol=1e-14)


@pytest.mark.parametrize(
    "frequency, message",
    [
        (30.0, "natural_frequency: 30 rad/s, but gravity alone makes joint 3 swing with 30; exp"),
        (1e200, "natural_frequency 1e+200 rad/s and damping_ratio 0.01 are too large for joint 3"),
    ],
)
def test_frequencies_that_no_spring_has_are_refused(frequency, message):
    with pytest.raises(InputError, match=re.escape(message)):
        springs_of(Elasticity([0.0, 0.0, frequency, 0.0]), INERTIA, [0, 0, 900.0 * 790, 0])
