"""Torque groups of a textbook arm, and published torques and inertias of the shipped device."""

import numpy as np
import pytest
from robots import ARM, URDF, loaded

from sdt_drake.robot.dynamics import torque_groups


@pytest.mark.parametrize("text, suffix", [(ARM, ".sdf"), (URDF, ".urdf")])
def test_groups_of_a_planar_arm_are_those_of_the_textbook(text, suffix):
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
    third = (np.sign(design.motion.vd) != np.sign(coupled)) & (np.abs(own) <= np.abs(coupled))
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
def test_range_along_the_reference_motion_is_that_of_the_independent_calculation(design, quantity):
    coupled = np.max(np.abs(design.torques.coupled), axis=0)
    values = coupled if quantity == "coupled" else getattr(design.inertia, quantity)
    for value, text in zip(values, PRINTED[quantity].split(), strict=True):
        assert f"{value:.{len(text.partition('.')[2])}f}" == text
