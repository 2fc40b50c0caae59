"""Torque groups against Drake's inverse dynamics and a textbook arm, Algorithm 1, and inertias."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces
from robots import ARM, chain_sdf

from sdt_drake.robot.dynamics import (
    InertiaRange,
    decouple,
    effective_inertia,
    inverse_dynamics,
    torque_groups,
    where_largest,
)
from sdt_drake.robot.robot import load_robot

# --- torque groups (Eq. 2) ------------------------------------------------------------------


@pytest.fixture(params=["shipped", "chain of 3 on a base", "chain of 7"])
def any_robot(request, robot, tmp_path):
    """The shipped device, and random chains with products of inertia and joint damping."""
    if request.param == "shipped":
        return robot
    path = tmp_path / "chain.sdf"
    path.write_text(chain_sdf(3, seed=5, base=True) if "3" in request.param else chain_sdf(7))
    return load_robot(path)


def random_states(robot, count: int):
    """q, v, vd [rad, rad/s, rad/s²] of shape (count, n)."""
    rng = np.random.default_rng(1)
    return rng.uniform([[[-3]], [[-2]], [[-5]]], [[[3]], [[2]], [[5]]], (3, count, robot.n))


def drake_torque(robot, q, v, vd):
    """Drake's inverse dynamics of one sample with all forces and the motors' inertia [N m]."""
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    return plant.CalcInverseDynamics(context, vd, forces)


def test_groups_sum_to_drakes_inverse_dynamics_without_the_motors(any_robot):
    q, v, vd = random_states(any_robot, 40)
    motors = any_robot.gear_ratio**2 * any_robot.rotor_inertia * vd
    expected = np.array([drake_torque(any_robot, *s) for s in zip(q, v, vd, strict=True)]) - motors
    groups = torque_groups(any_robot, q, v, vd)
    tolerance = 1e-9 * np.max(np.abs(expected), axis=0)
    assert np.all(np.abs(groups.total - expected) <= tolerance)
    whole = inverse_dynamics(any_robot, q, v, vd)
    assert np.all(np.abs(whole - groups.total - motors) <= tolerance)
    np.testing.assert_array_equal(groups.total, groups.inertial + groups.coupled)
    np.testing.assert_array_equal(
        groups.coupled, groups.reaction + groups.velocity + groups.gravity
    )


def test_each_group_has_its_own_cause(any_robot):
    q, v, vd = random_states(any_robot, 10)
    zero = np.zeros_like(q)
    full = torque_groups(any_robot, q, v, vd)
    at_rest = torque_groups(any_robot, q, zero, zero)
    for nothing in (at_rest.inertial, at_rest.reaction, at_rest.velocity):
        np.testing.assert_array_equal(nothing, zero)
    np.testing.assert_allclose(full.gravity, at_rest.gravity, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(full.inertial, full.d_kk * vd, rtol=1e-12)
    for k in range(any_robot.n):
        alone = torque_groups(any_robot, q, zero, vd * np.eye(any_robot.n)[k])
        np.testing.assert_array_equal(alone.reaction[:, k], 0)
        np.testing.assert_allclose(alone.inertial[:, k], full.inertial[:, k], rtol=1e-9)


def test_groups_of_a_planar_arm_are_those_of_the_textbook(tmp_path):
    (tmp_path / "arm.sdf").write_text(ARM)
    arm = load_robot(tmp_path / "arm.sdf")
    q, v, vd = random_states(arm, 20)
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
        "velocity": (
            -h * (2 * v[:, 0] * v[:, 1] + v[:, 1] ** 2) + damping * v[:, 0],
            h * v[:, 0] ** 2,
        ),
        "gravity": (-g * ((m1 * c1 + m2 * l1) * np.cos(q[:, 0]) + lower), -g * lower),
    }
    for name, columns in expected.items():
        np.testing.assert_allclose(
            getattr(groups, name), np.stack(columns, axis=1), rtol=1e-12, atol=1e-12, err_msg=name
        )


def test_a_sample_is_a_row_of_the_motion(any_robot):
    q, v, vd = random_states(any_robot, 5)
    motion = torque_groups(any_robot, q, v, vd)
    for i in range(5):
        sample = torque_groups(any_robot, q[i].tolist(), v[i], vd[i])
        for name in ("inertial", "reaction", "velocity", "gravity", "d_kk", "coupled", "total"):
            np.testing.assert_array_equal(getattr(sample, name), getattr(motion, name)[i])


# --- loads (Algorithm 1) --------------------------------------------------------------------


def algorithm_1(vd_k, d_kk, tau_coupled, r_k, sign):
    """Algorithm 1 of the paper, line by line: tau_LD, tau_alleviate and the branch taken."""
    tau_k = d_kk * vd_k + tau_coupled  # Eq. 4
    if np.sign(vd_k) == np.sign(tau_coupled):
        return tau_coupled / r_k, 0.0, 1
    if abs(d_kk * vd_k) > abs(tau_coupled):
        return 0.0, -tau_coupled / r_k, 2
    tau_ld = {"printed": -tau_k / r_k, "consistent": +tau_k / r_k}[sign]
    return tau_ld, (tau_k - tau_coupled) / r_k, 3


def cases():
    """vd, d_kk, tau_coupled, r: every combination of signs, zeros, equal sizes; random ones."""
    edges = itertools.product([-2.0, -1.0, 0.0, 1.0, 2.0], [1.0], [-4, -2, -1, 0, 1, 2, 4], [1, 8])
    rng = np.random.default_rng(0)
    random = zip(
        rng.normal(size=300),
        rng.uniform(0.1, 10, size=300),
        rng.normal(scale=5, size=300),
        rng.choice([0.5, 1, 67.2], size=300),
        strict=True,
    )
    return np.array([*edges, *random], dtype=float).T


@pytest.mark.parametrize("sign", ["printed", "consistent"])
def test_decouple_follows_algorithm_1(sign):
    vd, d_kk, coupled, r = cases()
    expected = [algorithm_1(*case, sign) for case in zip(vd, d_kk, coupled, r, strict=True)]
    load, alleviating, branch = np.transpose(expected)
    assert set(branch) == {1, 2, 3}
    split = decouple(d_kk * vd, coupled, r, sign)
    np.testing.assert_allclose(split.load_torque, load, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(split.alleviating_torque, alleviating, rtol=1e-12, atol=1e-12)
    if sign == "consistent":  # the motor and the others together bear the coupling
        np.testing.assert_allclose(r * (load - alleviating), coupled, rtol=1e-12, atol=1e-12)


def test_third_branch_covers_most_of_the_reference_motion(design):
    # Every sample at constant speed is in it. reference_design.md: 43 to 90 % of the motion.
    torques, vd = design.torques, design.motion.vd
    third = (np.sign(vd) != np.sign(torques.coupled)) & (
        np.abs(torques.inertial) <= np.abs(torques.coupled)
    )
    share = 100 * np.mean(third, axis=0)
    assert (round(min(share)), round(max(share))) == (43, 90)
    # There the printed load is the consistent one with the other sign.
    r = design.robot.gear_ratio
    consistent = decouple(torques.inertial, torques.coupled, r, "consistent").load_torque
    printed = decouple(torques.inertial, torques.coupled, r, "printed").load_torque
    np.testing.assert_array_equal(printed, np.where(third, -consistent, consistent))


# --- effective inertia (Eq. 3) --------------------------------------------------------------


def to_printed_digits(values, printed: str) -> list[str]:
    """`values` as text with as many decimals as each of the `printed` numbers."""
    return [
        f"{value:.{len(text.partition('.')[2])}f}"
        for value, text in zip(values, printed.split(), strict=True)
    ]


@pytest.mark.parametrize(
    "quantity, printed",
    [
        ("maximum", "4.2601 98.0127 796.298 250.280"),
        ("median", "4.004 77.61 792.10 250.28"),
        ("minimum", "3.830 66.82 774.84 250.28"),
        ("variation_percent", "10.09 31.82 2.69 0"),
    ],
)
def test_range_along_the_reference_motion_is_that_of_the_independent_calculation(
    design, quantity, printed
):
    values = getattr(design.inertia, quantity)
    assert to_printed_digits(values, printed) == printed.split()


def test_largest_coupling_torques_are_those_of_the_independent_calculation(design):
    largest = np.max(np.abs(design.torques.coupled), axis=0)
    assert to_printed_digits(largest, "4031 3419 678 288") == ["4031", "3419", "678", "288"]


def test_effective_inertia_is_on_the_motor_side(robot):
    # Eq. 3 by hand: 0.1291 + 18654.8 / 67.2² = 4.26007; direct drives add their rotor.
    i_eff = effective_inertia(robot, [[18654.8, 96.28, 795.769, 249.749], [0, 0, 0, 0]])
    np.testing.assert_allclose(i_eff[0], [4.26007, 98.01, 796.3, 250.28], rtol=1e-6)
    np.testing.assert_array_equal(i_eff[1], [0.1291, 1.73, 0.531, 0.531])


def test_range_of_a_few_samples_is_the_one_computed_by_hand():
    inertia = InertiaRange.of([[4.0, 7.0], [1.0, 7.0], [2.0, 7.0], [1.0, 7.0]])
    np.testing.assert_array_equal(inertia.maximum, [4, 7])
    np.testing.assert_array_equal(inertia.median, [1.5, 7])
    np.testing.assert_array_equal(inertia.minimum, [1, 7])
    np.testing.assert_array_equal(inertia.variation_percent, [75, 0])


def test_the_largest_inertia_is_taken_first_in_time_round_off_apart():
    d_kk = np.array([[1.0, 2.0], [3.0, 2.0 * (1 + 1e-15)], [3.0 * (1 + 1e-14), 2.0], [2.9, 1.0]])
    assert where_largest(d_kk).tolist() == [1, 0]
