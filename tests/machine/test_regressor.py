"""The regressor against Drake, and base parameters of random robots against their truth."""

import sys

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from known_truth import recorded_of, true_robot
from strategies import moving

from sdt_drake.machine.identify.base_parameters import (
    Unknown,
    rigid_columns,
    rigid_names,
    rigid_parameters,
)
from sdt_drake.machine.identify.equations import equations
from sdt_drake.machine.identify.filtering import stretches
from sdt_drake.robot.dynamics import inverse_dynamics


@settings(max_examples=20)
@given(moving(20))
def test_regressor_times_parameters_is_drakes_torque(drawn):
    robot, q, v, vd = drawn
    expected = inverse_dynamics(robot, q, v, vd) - robot.damping * v
    torque = rigid_columns(robot, q, v, vd) @ rigid_parameters(robot)
    assert np.all(np.abs(torque - expected) <= 1e-9 * np.abs(expected).max())


@settings(max_examples=6)
@given(moving(60, joints=st.integers(1, 4)))
def test_base_parameters_from_exact_torques_are_the_true_ones(drawn):
    robot, q, v, vd = drawn
    base, phi = Unknown.everything(robot).base, rigid_parameters(robot)
    W = rigid_columns(robot, q, v, vd).reshape(-1, 11 * robot.n)
    size = np.linalg.norm(W, axis=0)
    scaled = W / np.maximum(size, 1e-3 * size.max())
    # The rank by singular values, an independent count; then a fit to Drake's torques.
    assert len(base.independent) == np.linalg.matrix_rank(scaled, tol=1e-9) == len(base.words)
    tau = (inverse_dynamics(robot, q, v, vd) - robot.damping * v).ravel()
    own = size[base.independent]
    beta = np.linalg.lstsq(W[:, base.independent] / own, tau, rcond=1e-12)[0]
    off = np.abs(beta - own * (base.combination @ phi))
    assert np.all(off <= 1e-4 * np.abs(beta).max())  # smaller columns count as none


def test_words_of_the_shipped_device(robot):
    base = Unknown.everything(robot).base
    ways = dict(zip(rigid_names(robot), base.identifiable, strict=True))
    assert ways["mass of arm"] == "not at all"  # its axis is upright, and does not move
    assert ways["hz of roll_frame"] == "alone" and ways["hx of roll_frame"] == "in combination"
    first = next(words for words in base.words if words.startswith("Izz of arm"))
    # Parallel axes: what is 2.6 m out adds 2.6² m of every mass there.
    assert "+ 6.76 mass of roll_frame" in first and "+ motor inertia of planetary" in first


def test_equations_in_blocks_are_those_of_all(robot, monkeypatch):
    (stretch,), _ = stretches(recorded_of(true_robot(robot)))
    arguments = robot, Unknown.everything(robot), [(0, 12.0, stretch)], 4.0
    whole = equations(*arguments)
    monkeypatch.setattr(sys.modules[equations.__module__], "_BLOCK_SAMPLES", 900)
    parts = equations(*arguments)
    assert np.all(parts.part == 0)
    for name in ("time", "q", "tau", "known", "nominal", "rigid", "friction"):
        one, other = getattr(parts, name), getattr(whole, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-7 * np.abs(other).max())
