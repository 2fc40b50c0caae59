"""Torque groups, friction and springs by hand, and published torques and inertias of the device."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.robots import ARM, URDF, loaded

from sdt_drake.io.errors import InputError
from sdt_drake.robot import device
from sdt_drake.robot.device import Elasticity, Friction, springs_of
from sdt_drake.robot.dynamics import torque_groups, where_largest


@pytest.mark.parametrize("text, suffix", [(ARM, ".sdf"), (URDF, ".urdf")])
def test_torque_groups_of_planar_arm_equal_textbook(text, suffix):
    arm = loaded(text, suffix)
    q, v, vd = np.random.default_rng(1).uniform(-3, 3, (3, 20, 2))
    groups = torque_groups(arm, q, v, vd)
    # Lengths, masses and inertias of ARM; positive angles lower the links.
    l1, c1, c2, m1, m2, I1, I2, damping, g = 0.8, 0.5, 0.3, 4, 2, 0.5, 0.2, 0.7, 9.81
    cos2, sin2 = np.cos(q[:, 1]), np.sin(q[:, 1])
    d11 = m1 * c1**2 + I1 + m2 * (l1**2 + c2**2 + 2 * l1 * c2 * cos2) + I2
    d12 = m2 * (c2**2 + l1 * c2 * cos2) + I2
    d22 = np.full_like(d11, m2 * c2**2 + I2)
    h = m2 * l1 * c2 * sin2
    lower = m2 * c2 * np.cos(q[:, 0] + q[:, 1])
    expected = {
        "d_kk": (d11, d22),
        "inertial": (d11 * vd[:, 0], d22 * vd[:, 1]),
        "reaction": (d12 * vd[:, 1], d12 * vd[:, 0]),
        "velocity": (damping * v[:, 0] - h * (2 * v[:, 0] + v[:, 1]) * v[:, 1], h * v[:, 0] ** 2),
        "gravity": (-g * ((m1 * c1 + m2 * l1) * np.cos(q[:, 0]) + lower), -g * lower),
    }
    for name, columns in expected.items():
        found, by_hand = getattr(groups, name), np.stack(columns, axis=1)
        np.testing.assert_allclose(found, by_hand, rtol=1e-12, atol=1e-12, err_msg=name)


def test_third_branch_of_algorithm_1_covers_most_of_the_reference_motion(design):
    # Every sample at constant speed is in it. reference_design.md: 43 to 90 % of the motion.
    own, coupled = design.torques.inertial, design.torques.coupled
    third = (np.sign(design.reference.tracked.vd) != np.sign(coupled)) & (
        np.abs(own) <= np.abs(coupled)
    )
    share = 100 * np.mean(third, axis=0)
    assert (round(min(share)), round(max(share))) == (43, 90)


PRINTED = {
    "maximum": "4.2601 98.0127 796.298 250.280",
    "median": "4.004 77.61 792.10 250.28",
    "minimum": "3.830 66.82 774.84 250.28",
    "variation_percent": "10.09 31.82 2.69 0",
    "coupled": "4031 3419 678 288",
}


@pytest.mark.parametrize("quantity", PRINTED)
def test_ranges_along_reference_motion_equal_independent_calculation(design, quantity):
    coupled = np.max(np.abs(design.torques.coupled), axis=0)
    values = coupled if quantity == "coupled" else getattr(design.inertia, quantity)
    for value, text in zip(values, PRINTED[quantity].split(), strict=True):
        assert f"{value:.{len(text.partition('.')[2])}f}" == text


# --- friction and springs of elastic joints against their formulas ---------------------------

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


def test_friction_torque_equals_formula():
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
    # Joint 4 alone has its peak at twice the speed.
    own = replace(FRICTION, stribeck_speed=0.02, stribeck_speeds=[V_S, V_S, V_S, 2 * V_S])
    np.testing.assert_array_equal(at(own, V_S)[:3], at(FRICTION, V_S)[:3])
    assert at(own, 2 * V_S)[3] == pytest.approx(50 + 2 * 0.06, rel=1e-12)
    with pytest.raises(InputError, match=r"stribeck_speed: expected only without stribeck_speeds"):
        replace(own, stribeck_speed=V_S)


def test_link_swings_at_given_frequency_on_spring_and_gravity():
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


def test_largest_inertia_is_the_first_within_round_off():
    d_kk = [[1.0, 5.0, 7 - 1e-10], [3.0, 2.0, 7.0], [3.0, 5.0, 7.0]]
    np.testing.assert_array_equal(where_largest(d_kk), [1, 0, 0])
