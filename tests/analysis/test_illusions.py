"""Illusions: felt less true, where they begin and end, and those of the training motions."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sdt_drake.analysis import illusions as module
from sdt_drake.analysis.illusions import (
    LEVELS,
    Illusion,
    feel,
    illusions,
    intended_illusions,
    quantities,
    true_attitude,
)
from sdt_drake.io.yaml_files import read_yaml
from sdt_drake.motion import load_plan, shipped_motions
from sdt_drake.robot.head import head_motion, head_motion_of_samples

PERIOD = 0.02


def held(robot, q, samples=50):
    """The head at joint angles [rad]."""
    q = np.tile(np.array(q, dtype=float), (samples, 1))
    return head_motion(robot, q, 0 * q, 0 * q)


def test_true_attitude_is_that_of_a_head_that_has_been_still(robot):
    for q in ([0, 0.4, 0, 0], [1, -0.6, 0, 0], [0, 0, 0.5, 0], [2, 0.3, -0.4, 0.7]):
        head = held(robot, q)
        felt = feel(head, PERIOD, "clark2019")
        for own, true in zip((felt.roll, felt.pitch), true_attitude(head), strict=True):
            np.testing.assert_allclose(own, true, atol=1e-6)
        assert illusions(felt, head) == []
    assert true_attitude(held(robot, [0, 0.4, 0, 0]))[0][0] == pytest.approx(0.4)  # to the right


def test_turning_the_world_about_the_vertical_changes_nothing(robot):
    """By the first joint, which stands still."""
    time = PERIOD * np.arange(300)
    q = np.outer(np.sin(time), [0, 0.4, 0.3, 0.5])
    first, other = (
        head_motion_of_samples(robot, PERIOD, turned, np.gradient(turned, PERIOD, axis=0))
        for turned in (q, q + np.eye(4)[0])
    )
    usual, turned = (quantities(feel(h, PERIOD, "slow_yaw"), h) for h in (first, other))
    for name in LEVELS:
        np.testing.assert_allclose(turned[name], usual[name], atol=1e-3)


def test_an_illusion_has_its_peak_start_and_end(robot):
    head = held(robot, [0, 0, 0, 0], samples=500)
    felt = feel(head, PERIOD, "clark2019")
    rate = np.zeros((500, 3))
    rate[:, 2] = np.radians(np.interp(felt.time, [2, 3, 5], [0, -20, 0]))
    (found,) = illusions(replace(felt, rate=rate), head)
    assert found == Illusion("yaw rate", *map(pytest.approx, (-20, 0, 3, 2.14, 4.74), [0.01] * 5))
    assert found.error == pytest.approx(-20)
    assert str(found) == (
        "yaw rate: felt -20.0 deg/s at 3.0 s where it is 0.0; wrong from 2.1 s for 2.6 s"
    )


def test_angles_go_over_the_top():
    """170 deg to the right, felt as 170 to the left, is 20 deg off."""
    down = np.array([[0, -np.sin(np.radians(170)), -np.cos(np.radians(170))]])
    rotation = np.zeros((1, 3, 3))
    rotation[:, 2] = -down
    head = SimpleNamespace(rotation=rotation, angular_velocity=np.zeros((1, 3)))
    felt = SimpleNamespace(
        roll=np.radians([-170.0]), pitch=np.zeros(1), rate=np.zeros((1, 3)), time=np.zeros(1)
    )
    own, true = quantities(felt, head)["roll"]
    assert (own[0], true[0]) == (pytest.approx(190), pytest.approx(170))


@pytest.fixture(scope="module")
def intended(robot):
    return {row.motion: row for row in intended_illusions(robot)}


def test_every_training_motion_says_what_it_is_meant_for(intended):
    assert set(intended) == set(shipped_motions())
    not_predicted = {
        m for m, row in intended.items() if not all(map(row.is_predicted, row.predicted))
    }
    assert not_predicted == {"leans", "g_excess"}


@pytest.mark.parametrize("name", ["leans", "graveyard_spin", "post_roll"])
def test_an_illusion_after_a_stop_is_looked_for_after_it(robot, name):
    texts = read_yaml(Path(module.__file__).with_name("illusions.yaml"))
    start, end = texts[name]["between"]
    motion = load_plan(name, robot, period=PERIOD).motion
    after = motion.time >= start
    assert not motion.v[after].any() and motion.v[~after][-3:].any()
    assert end <= motion.duration


def test_findings_tell_what_is_predicted(intended):
    from test_findings import rows_of_table

    sets = ("clark2019", "slow_yaw", "rader2009", "irmak2023")
    rows = rows_of_table("motion | felt")
    assert {row[0] for row in rows} == set(intended)
    for name, felt, *values in rows:
        assert felt.startswith(intended[name].quantity)
        predicted = [intended[name].predicted[one] for one in sets]
        np.testing.assert_allclose([float(value) for value in values], predicted, atol=0.051)
