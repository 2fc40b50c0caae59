"""Illusions: felt less true, those of the training motions, and pilots who differ."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.documents import rows_of_table

from sdt_drake.io.resources import find_file
from sdt_drake.motion import IntendedIllusion, shipped_motions
from sdt_drake.pilot import load_perception
from sdt_drake.pilot.head import head_motion
from sdt_drake.pilot.illusions import (
    PERIOD,
    Illusion,
    Intended,
    feel,
    felt_apart,
    illusion_of,
    illusions,
    intended_illusion,
    largest_error,
    planned_head,
    quantities,
    true_attitude,
)
from sdt_drake.pilot.pilots import Feeling, draw_pilots

SETS = ("clark2019", "slow_yaw", "rader2009", "irmak2023")


def held(robot, q, samples=50):
    """The head at joint angles [rad]."""
    q = np.tile(np.array(q, dtype=float), (samples, 1))
    return head_motion(robot, q, 0 * q, 0 * q)


# --- felt and true ------------------------------------------------------------------------------


def test_illusion_has_peak_start_and_end_of_its_error(robot):
    head = held(robot, [0, 0, 0, 0], samples=500)
    felt = feel(head, PERIOD, "clark2019")
    rate = np.zeros((500, 3))
    rate[:, 2] = np.radians(np.interp(felt.time, [2, 3, 5], [0, -20, 0]))
    wrong = replace(felt, rate=rate)
    (found,) = illusions(wrong, head)
    assert found == Illusion("yaw rate", *map(pytest.approx, (-20, 0, 3, 2.14, 4.74), [0.01] * 5))
    assert found.error == pytest.approx(-20) and "felt -20.0 deg/s, true 0.0 deg/s" in str(found)
    assert felt_apart(felt, wrong) == (0, pytest.approx(np.radians(20), rel=1e-3))


def test_angle_difference_is_the_short_way_round(robot):
    """170 deg to the right, felt as 170 to the left, is 20 deg off."""
    head = held(robot, [0, np.radians(170), 0, 0])
    felt = feel(head, PERIOD, "clark2019")
    mirrored = replace(felt, gravity=felt.gravity * [1, -1, 1])
    assert felt_apart(felt, mirrored)[0] == pytest.approx(np.radians(20), abs=1e-6)
    own, true = quantities(mirrored, head)["roll"]
    assert (own[0], true[0]) == (pytest.approx(190), pytest.approx(170))


@pytest.mark.parametrize(
    ("sign", "from_start", "expected"),
    [(1, False, 3), (-1, False, -2), (0, False, 3), (0, True, -5), (1, True, 0)],
)
def test_intended_illusion_has_sign_and_time(robot, sign, from_start, expected):
    head = held(robot, [0, 0, 0, 0], samples=500)
    felt = feel(head, PERIOD, "clark2019")
    rate = np.radians(np.interp(felt.time, [0, 3, 5, 8, 8.02], [9, 2, 3, -2, 9]))
    wrong = replace(felt, rate=np.outer(rate, [0, 1, 0]))
    meant = IntendedIllusion(
        quantity="pitch rate", sign=sign, start=5, end=8, from_start=from_start
    )
    assert largest_error(wrong, head, meant) == pytest.approx(expected, abs=1e-9)


# --- training motions ---------------------------------------------------------------------------


@pytest.mark.documents
@pytest.mark.parametrize("k", range(8))
def test_table_of_illusions_equals_predictions(robot, k):
    """With one of the sets for each motion, in turn; the table shows which is not predicted."""
    name, felt, *values, _ = rows_of_table("motion | felt")[k]
    assert {row[0] for row in rows_of_table("motion | felt")} == set(shipped_motions())
    found = intended_illusion(name, robot, [SETS[k % 4]])
    assert felt.startswith(found.quantity)
    assert found.predicted[SETS[k % 4]] == pytest.approx(float(values[k % 4]), abs=0.051)
    level = 2.5 if "rate" in felt else 1.7
    assert found.is_predicted(SETS[k % 4]) == (abs(found.predicted[SETS[k % 4]]) > level)
    assert (min(abs(float(value)) for value in values) > level) == (name != "g_excess")


@pytest.mark.documents
def test_five_illusions_need_no_canals(robot):
    """A pilot who feels no rotation and takes the force for gravity; README says how many."""
    rows = {name: float(row[-1]) for name, *row in rows_of_table("motion | felt")}
    needless = []
    for name, told in rows.items():
        head, meant = planned_head(name, robot), illusion_of(name)
        down = -head.specific_force
        down = down / np.linalg.norm(down, axis=1, keepdims=True)
        felt = replace(feel(head, PERIOD, "slow_yaw"), gravity=down, rate=0 * down)
        error = largest_error(felt, head, meant)
        assert error == pytest.approx(told, abs=0.051), name
        if Intended(name, meant.quantity, {"none": error}).is_predicted("none"):
            needless.append(name)
    assert needless == ["leans", "graveyard_spiral", "coriolis", "somatogravic", "inversion"]


def test_leans_bank_is_hidden_by_the_force_until_the_roll_upright(robot):
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


def test_motion_file_may_name_its_illusion(robot, tmp_path):
    text = find_file("post_roll", "motion").read_text(encoding="utf-8")
    own = tmp_path / "own.yaml"
    own.write_text(text.replace("sign: -1", "sign: 1"), encoding="utf-8")
    found = intended_illusion(str(own), robot, ["slow_yaw"])
    assert found.predicted["slow_yaw"] == 0 and not found.is_predicted("slow_yaw")
    assert "does not predict" in found.sentence("slow_yaw") and "2.5" in found.sentence("slow_yaw")
    assert illusion_of("reference") is None


# --- pilots -------------------------------------------------------------------------------------


def test_random_pilots_differ_in_published_parameters_alone():
    own = load_perception("slow_yaw")
    drawn = draw_pilots(own, 3000)
    tau, k_w = (np.array([getattr(pilot, field) for pilot in drawn]) for field in ("tau", "k_w"))
    np.testing.assert_array_equal(tau, np.tile(tau[:, :1], 3))
    assert tau[:, 0].mean() == pytest.approx(5.7, rel=0.01)
    assert tau[:, 0].std() / 5.7 == pytest.approx(0.6 / 4.2, rel=0.05)
    assert np.all(k_w[:, :2] == own.k_w[0]) and k_w.min() > 0
    # Felt yaw lasts (k_w + 1) tau; people report 13 to 20 s, evenly, whatever their cupula is like.
    lasts = (k_w[:, 2] + 1) * tau[:, 0] / ((own.k_w[2] + 1) * 5.7)
    np.testing.assert_allclose([lasts.min(), lasts.max()], [13 / 16.5, 20 / 16.5], atol=2e-3)
    assert lasts.std() == pytest.approx(7 / 16.5 / 12**0.5, rel=0.05)
    assert abs(np.corrcoef(lasts, tau[:, 0])[0, 1]) < 0.06
    for field in ("k_fw", "k_fg", "k_a", "tau_a", "cutoff"):
        assert all(getattr(pilot, field) == getattr(own, field) for pilot in drawn)
    assert draw_pilots(own, 5) == drawn[:5] != draw_pilots(own, 5, seed=1)


@pytest.mark.parametrize("felt", [168, 0, 200])
def test_share_interval_equals_wilsons(felt):
    """With z = 1.96: (p + z²/2n ± z sqrt(p (1 - p) / n + z²/4n²)) / (1 + z²/n)."""
    errors = np.where(np.arange(200) < felt, -2.0, 1.6)  # of either sign; 1.7 deg is felt
    n, p, z = 200, felt / 200, 1.96
    half = z * np.sqrt(p * (1 - p) / n + z**2 / 4 / n**2)
    low, high = abs(100 * (p + z**2 / 2 / n + np.array([-1, 1]) * half) / (1 + z**2 / n))
    said = str(Feeling("roll", errors))
    assert said.startswith(f"{felt} of 200 pilots ({100 * p:.0f} %")
    assert said.endswith(f"{low:.0f} to {high:.0f} %)")
