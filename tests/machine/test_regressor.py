"""The regressor against Drake, and base parameters against what cannot be told."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from strategies import moving

from sdt_drake.machine.identify.base_parameters import (
    Unknown,
    rigid_columns,
    rigid_names,
    rigid_parameters,
)
from sdt_drake.robot.dynamics import inverse_dynamics

FEW = settings(max_examples=8)


@FEW
@given(moving(20))
def test_regressor_is_drakes_inverse_dynamics(case):
    robot, q, v, vd = case
    expected = inverse_dynamics(robot, q, v, vd) - robot.damping * v
    torque = rigid_columns(robot, q, v, vd) @ rigid_parameters(robot)
    assert np.all(np.abs(torque - expected) <= 1e-9 * np.abs(expected).max(axis=0))


@FEW
@given(moving(60))
def test_base_parameters_say_all_that_torques_can_tell(case):
    robot = case[0]
    base = Unknown.everything(robot).base
    W = rigid_columns(*case).reshape(-1, 11 * robot.n)
    # The rank by singular values, an independent count; and the same torques from beta alone.
    size = np.linalg.norm(W, axis=0)
    scaled = W / np.maximum(size, 1e-3 * size.max())
    assert len(base.independent) == np.linalg.matrix_rank(scaled, tol=1e-9)
    back = W[:, base.independent] @ base.combination
    assert np.all(np.abs(back - W).max(axis=0) <= 1e-8 * (1 + np.abs(W).max(axis=0)))
    assert len(base.words) == len(base.independent)


def test_words_of_the_shipped_device(robot):
    base = Unknown.everything(robot).base
    said = dict(zip(rigid_names(robot), base.identifiable, strict=True))
    assert said["mass of arm"] == "not at all"  # its axis is upright, and does not move
    assert said["hz of roll_frame"] == "alone" and said["hx of roll_frame"] == "in combination"
    first = next(words for words in base.words if words.startswith("Izz of arm"))
    # Parallel axes: what is 2.6 m out adds 2.6² m of every mass there.
    assert "+ 6.76 mass of roll_frame" in first and "+ motor inertia of planetary" in first
