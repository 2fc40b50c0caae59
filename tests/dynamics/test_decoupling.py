"""Algorithm 1: against the paper's own text, and what holds for every split."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from sdt_drake.dynamics import decouple


def algorithm_1(vd_k, d_kk, tau_coupled, r_k, sign):
    """Algorithm 1 of the paper, line by line: tau_LD, tau_alleviate and the branch taken."""
    tau_k = d_kk * vd_k + tau_coupled  # Eq. 4
    if np.sign(vd_k) == np.sign(tau_coupled):
        return tau_coupled / r_k, 0.0, 1
    if abs(d_kk * vd_k) > abs(tau_coupled):
        return 0.0, -tau_coupled / r_k, 2
    tau_ld = {"printed": -tau_k / r_k, "consistent": +tau_k / r_k}[sign]
    return tau_ld, (tau_k - tau_coupled) / r_k, 3


def _cases():
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
    vd, d_kk, coupled, r = _cases()
    expected = [algorithm_1(*case, sign) for case in zip(vd, d_kk, coupled, r, strict=True)]
    load, alleviating, branch = np.transpose(expected)
    assert set(branch) == {1, 2, 3}
    split = decouple(d_kk * vd, coupled, r, sign)
    np.testing.assert_allclose(split.load_torque, load, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(split.alleviating_torque, alleviating, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    "inertial, coupled, load, alleviating",
    [
        (2, 3, 3, 0),  # the same sign: all of it is load
        (-2, -3, -3, 0),
        (5, -3, 0, 3),  # the others help, the motor does the rest
        (-5, 3, 0, -3),
        (2, -3, -1, 2),  # the others do more than is wanted, the motor brakes
        (-2, 3, 1, -2),
        (0, 3, 3, 0),  # constant speed: all of it is load
        (0, -3, -3, 0),
        (2, 0, 0, 0),
        (0, 0, 0, 0),
        (3, -3, 0, 3),  # the others do it all
        (-3, 3, 0, -3),
    ],
)
def test_consistent_split_is_the_one_reasoned_by_hand(inertial, coupled, load, alleviating):
    split = decouple([inertial, inertial], [coupled, coupled], [1, 4])
    np.testing.assert_array_equal(split.load_torque, [load, load / 4])
    np.testing.assert_array_equal(split.alleviating_torque, [alleviating, alleviating / 4])


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
