"""Illusions: felt less true, where they begin and end, and those of the training motions."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sdt_drake.analysis.illusions import (
    LEVELS,
    Illusion,
    feel,
    illusion_of,
    illusions,
    intended_illusion,
    intended_illusions,
    planned_head,
    quantities,
    true_attitude,
)
from sdt_drake.io.resources import find_file
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
        "yaw rate: felt -20.0 deg/s, true 0.0 deg/s at 3.0 s; illusion from 2.1 to 4.7 s"
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
    assert not_predicted == {"g_excess"}


@pytest.mark.parametrize("name", ["graveyard_spin", "post_roll"])
def test_an_illusion_after_a_stop_is_looked_for_after_it(robot, name):
    meant = illusion_of(name)
    motion = load_plan(name, robot, period=PERIOD).motion
    after = motion.time >= meant.start
    assert not motion.v[after].any() and motion.v[~after][-3:].any()
    assert meant.end <= motion.duration


def test_the_force_hides_the_bank_of_the_leans_until_the_roll_upright(robot):
    """Its bank is acos(1 / 1.06) = 19.4 deg; upright, the force lies as far to the right."""
    head = planned_head("leans", robot)
    time = PERIOD * np.arange(len(head.rotation))
    roll = np.degrees(true_attitude(head)[0])
    force = np.degrees(np.arctan2(head.specific_force[:, 1], head.specific_force[:, 2]))
    turning, upright = time < 48, (time > 50.2) & (time < 60)
    assert roll[turning].min() == pytest.approx(-19.37, abs=0.05)
    assert np.abs(force[turning]).max() < 1 and np.abs(roll[time > 50.2]).max() < 2
    np.testing.assert_allclose(force[upright], 19.4, atol=0.5)
    assert np.abs(np.gradient(roll[turning], PERIOD)).max() < 2.5  # Mulder's limit


def test_an_own_motion_says_which_illusion_it_is_meant_to_give(robot, tmp_path):
    text = find_file("leans", "motion").read_text(encoding="utf-8")
    own = tmp_path / "own.yaml"
    own.write_text(text.replace("sign: 1", "sign: -1"), encoding="utf-8")
    found = intended_illusion(str(own), robot, ["slow_yaw"])
    assert found.predicted["slow_yaw"] == 0 and not found.is_predicted("slow_yaw")
    assert found.sentence("slow_yaw") == (
        "slow_yaw does not predict the illusion: roll felt at most 0.0 deg off, noticed from 1.7 "
        "deg on."
    )
    assert illusion_of("reference") is None


def test_findings_tell_what_is_predicted(intended):
    from test_findings import rows_of_table

    sets = ("clark2019", "slow_yaw", "rader2009", "irmak2023")
    rows = rows_of_table("motion | felt")
    assert {row[0] for row in rows} == set(intended)
    for name, felt, *values in rows:
        assert felt.startswith(intended[name].quantity)
        predicted = [intended[name].predicted[one] for one in sets]
        np.testing.assert_allclose([float(value) for value in values], predicted, atol=0.051)
