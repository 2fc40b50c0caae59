"""The regressor against Drake, and base parameters against what cannot be told."""

from __future__ import annotations

import numpy as np
import pytest
from test_robot import chain_sdf

from sdt_drake.dynamics import inverse_dynamics
from sdt_drake.identification.base_parameters import (
    base_parameters,
    rigid_columns,
    rigid_names,
    rigid_parameters,
)
from sdt_drake.robot import load_robot


@pytest.fixture(params=["shipped", "chain of 3 on a base", "chain of 7"])
def case(request, robot, tmp_path):
    """Name and robot: the shipped device with a welded payload, and random chains."""
    path = tmp_path / "chain.sdf"
    if request.param == "shipped":
        return request.param, robot
    path.write_text(chain_sdf(3, seed=5, base=True) if "3" in request.param else chain_sdf(7))
    return request.param, load_robot(path)


def random_motion(robot, count, seed=1):
    """q, v, vd [rad, rad/s, rad/s²] of shape (count, n)."""
    rng = np.random.default_rng(seed)
    return rng.uniform([[[-3]], [[-2]], [[-5]]], [[[3]], [[2]], [[5]]], (3, count, robot.n))


def test_regressor_is_drakes_inverse_dynamics(case):
    _, robot = case
    q, v, vd = random_motion(robot, 40)
    expected = inverse_dynamics(robot, q, v, vd) - robot.damping * v
    torque = rigid_columns(robot, q, v, vd) @ rigid_parameters(robot)
    assert np.all(np.abs(torque - expected) <= 1e-9 * np.abs(expected).max(axis=0))


def test_base_parameters_say_all_that_torques_can_tell(case):
    _, robot = case
    base = base_parameters(robot)
    W = rigid_columns(robot, *random_motion(robot, 60)).reshape(-1, 11 * robot.n)
    # The rank by singular values, an independent count; and the same torques from beta alone.
    size = np.linalg.norm(W, axis=0)
    scaled = W / np.maximum(size, 1e-3 * size.max())
    assert len(base.independent) == np.linalg.matrix_rank(scaled, tol=1e-9)
    back = W[:, base.independent] @ base.combination
    assert np.all(np.abs(back - W).max(axis=0) <= 1e-8 * (1 + np.abs(W).max(axis=0)))
    assert len(base.words) == len(base.independent)


def test_words_of_the_shipped_device(robot):
    base = base_parameters(robot)
    said = dict(zip(rigid_names(robot), base.identifiable, strict=True))
    assert said["mass of arm"] == "not at all"  # its axis is upright, and does not move
    assert said["hz of roll_frame"] == "alone" and said["hx of roll_frame"] == "in combination"
    first = next(words for words in base.words if words.startswith("Izz of arm"))
    # Parallel axes: what is 2.6 m out adds 2.6² m of every mass there.
    assert "+ 6.76 mass of roll_frame" in first and "+ motor inertia of planetary" in first
