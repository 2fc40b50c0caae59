"""Friction and springs of elastic joints against their formulas, and what is refused."""

import numpy as np
import pytest

from sdt_drake.robot import device
from sdt_drake.robot.device import Elasticity, Friction, springs_of

V_S = 0.03  # rad/s
COULOMB, VISCOUS = [300.0, 60.0, 0.0, 20.0], [40.0, 0.0, 8.0, 2.0]
BREAKAWAY = [450.0, 60.0, 10.0, 50.0]
FRICTION = Friction(COULOMB, VISCOUS, BREAKAWAY, stribeck_speed=V_S)
LOADED = Friction(COULOMB, VISCOUS, BREAKAWAY, stribeck_speed=V_S, offset=[0.0, -70.0, 5.0, 0.0])

OMEGA = [60.0, 0.0, 150.0, 30.0]  # rad/s
INERTIA = np.array([18000.0, 90.0, 790.0, 250.0])  # kg m²
GRAVITY = np.array([0.0, 500.0, 900.0, -300.0])  # N m/rad


def at(friction, v):
    """Friction at the same speed of every joint."""
    return device.sliding_friction(device.friction_parameters(friction, 4), np.full(4, v))


def test_friction_by_hand():
    # Joint 1 at 2 v_s: 300 + 150 * 2 exp(-3 / 2) + 40 * 0.06.
    assert at(FRICTION, 2 * V_S)[0] == pytest.approx(300 + 66.9390480 + 2.4, rel=1e-9)
    # Joint 3 at v_s / 2: 10 / 2 exp(3 / 8) + 8 * 0.015, and with what it carries both ways.
    assert at(FRICTION, V_S / 2)[2] == pytest.approx(7.2749571 + 0.12, rel=1e-7)
    assert at(LOADED, -V_S / 2)[2] == pytest.approx(5 - 7.2749571 - 0.12, rel=1e-7)
    # At v_s, breakaway and 40 * 0.03; where breakaway is Coulomb friction, there is no peak.
    assert at(FRICTION, V_S)[0] == pytest.approx(450 + 1.2, rel=1e-12)
    np.testing.assert_array_equal([at(FRICTION, v)[1] for v in (V_S / 2, V_S, 9 * V_S)], 60)
    np.testing.assert_array_equal(at(FRICTION, 0.0), 0)
    np.testing.assert_array_equal(at(LOADED, 0.0), LOADED.offset)
    np.testing.assert_array_equal(at(FRICTION, -V_S), -at(FRICTION, V_S))


def test_spring_and_gravity_swing_the_link_at_the_given_frequency():
    """d x'' + c x' + (k + k_g) x = 0 has the roots of omega and zeta."""
    assert Elasticity(OMEGA).encoder == "motor"
    for elasticity, zeta in (
        (Elasticity(OMEGA, damping_ratio=0.2), 0.2),
        (Elasticity(OMEGA), 0.01),
    ):
        springs = springs_of(elasticity, INERTIA, GRAVITY)
        for k in (0, 2, 3):
            stiffness = springs.stiffness[k] + GRAVITY[k]
            roots = np.roots([INERTIA[k], springs.damping[k], stiffness])
            np.testing.assert_allclose(np.abs(roots), OMEGA[k], rtol=1e-12)
            np.testing.assert_allclose(-roots.real / np.abs(roots), zeta, rtol=1e-12)
