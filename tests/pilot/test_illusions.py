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
    Value,
    feel,
    felt_apart,
    force_alone,
    illusion_of,
    illusions,
    intended_illusion,
    largest_value,
    planned_head,
    quantities,
    true_attitude,
)
from sdt_drake.pilot.pilots import Feeling, draw_pilots

SETS = (
    "allred", "clark2015", "clark2019", "familiar_turn", "irmak2023", "rader2009", "slow_yaw",
)  # fmt: skip


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
    ("sign", "more", "expected"),
    [
        (1, {}, (2, 7.32, 8)),  # felt 1 to -5 less true 1 to -7
        (-1, {}, (0,)),
        (-1, {"of": "felt"}, (-5, 6.74, 8)),
        (0, {"of": "felt"}, (-5, 6.74, 8)),
        (0, {"of": "felt", "from_start": True}, (-6, 6.24, 8)),
        (1, {"of": "felt", "baseline": 8}, (6, 5, 6.74)),
        (1, {"of": "felt", "baseline": 5}, (0,)),
    ],
)
def test_value_of_an_illusion_has_sign_time_and_baseline(robot, sign, more, expected):
    head = held(robot, [0, 0, 0, 0], samples=500)
    felt = feel(head, PERIOD, "clark2019")
    own = np.interp(felt.time, [0, 3, 5, 8, 8.02], [9, 1, 1, -5, 9])
    true = np.interp(felt.time, [5, 8, 8.02], [1, -7, 0])
    wrong = replace(felt, rate=np.outer(np.radians(own), [0, 1, 0]))
    turning = replace(head, angular_velocity=np.outer(np.radians(true), [0, 1, 0]))
    meant = IntendedIllusion(quantity="pitch rate", sign=sign, start=5, end=8, **more)
    own = largest_value(wrong, turning, meant)
    if "of" not in more:
        expected = (2,) if sign == 1 else (0,)  # below the level of 2.5 deg/s
    np.testing.assert_allclose(
        [own.size, own.start, own.end], [*expected, *[np.nan] * (3 - len(expected))], atol=0.021
    )


# --- training motions ---------------------------------------------------------------------------

NEEDLESS = {"somatogravic"}
"""Motions whose illusion a pilot without canals has, too."""


@pytest.fixture(scope="module")
def planned(robot):
    """The head in each training motion."""
    return {name: planned_head(name, robot) for name in shipped_motions()}


@pytest.mark.documents
@pytest.mark.parametrize("k", range(8))
def test_table_of_illusions_equals_predictions(robot, k):
    """With one of the sets for each motion, in turn; the table shows which is not predicted."""
    name, quantity, *values, none = rows_of_table("motion | value")[k]
    assert {row[0] for row in rows_of_table("motion | value")} == set(shipped_motions())
    chosen = SETS[k % len(SETS)]
    found = intended_illusion(name, robot, [chosen])
    assert quantity.startswith(found.quantity) and ("felt" in quantity) == (
        found.meant.of == "felt"
    )
    sizes = {model: float(value.split()[0]) for model, value in zip(SETS, values, strict=True)}
    assert found.predicted[chosen].size == pytest.approx(sizes[chosen], abs=0.051)
    level = 2.5 if "rate" in quantity else 1.7
    assert found.is_felt(chosen) == (abs(sizes[chosen]) > level)
    felt = {model for model, size in sizes.items() if abs(size) > level}
    assert felt == ({"clark2015", "familiar_turn"} if name == "g_excess" else set(SETS))
    assert found.is_predicted(chosen) == (chosen in felt and name not in NEEDLESS)
    assert found.force_alone.size == pytest.approx(float(none), abs=0.051)


def test_a_pilot_without_canals_has_the_somatogravic_illusion_alone(planned):
    """Whose force is down, and who feels no rotation; by hand, without the observer."""
    for name, head in planned.items():
        meant = illusion_of(name)
        f = head.specific_force
        own = {
            "roll": np.degrees(np.arctan2(f[:, 1], f[:, 2])),
            "pitch": np.degrees(np.arctan2(f[:, 0], np.hypot(f[:, 1], f[:, 2]))),
        }.get(meant.quantity, np.zeros(len(f)))
        time = PERIOD * np.arange(len(f))
        inside = (time >= meant.start) & (time <= meant.end)
        if meant.of == "error":
            roll, pitch = np.degrees(true_attitude(head))
            rates = np.degrees(head.angular_velocity).T
            true = dict(zip(quantities_of(), (roll, pitch, *rates), strict=True))
            own = own - true[meant.quantity]
        if meant.baseline is not None:
            own = own - own[round(meant.baseline / PERIOD)]
        largest = max(0, (meant.sign * own[inside]).max())
        level = 2.5 if "rate" in meant.quantity else 1.7
        assert (largest > level) == (name in NEEDLESS), (name, largest)


def quantities_of():
    return ("roll", "pitch", "roll rate", "pitch rate", "yaw rate")


def test_pilot_without_canals_feels_the_force_and_no_rotation(robot):
    head = held(robot, [0, 0.2, 0.1, 0])
    felt = force_alone(feel(head, PERIOD, "clark2019"))
    np.testing.assert_allclose(felt.gravity, -head.rotation[:, 2], atol=1e-12)
    assert not felt.rate.any() and not felt.acceleration.any()


def test_illusion_of_the_force_alone_is_not_predicted(robot):
    found = intended_illusion("somatogravic", robot, ["slow_yaw"])
    assert found.is_felt("slow_yaw") and not found.is_predicted("slow_yaw")
    assert found.force_alone == Value(
        *map(pytest.approx, (30.8, 4.4, 37.7), [0.05, 1.5, 1.5], [0.05, 1.5, 1.5])
    )
    assert "but so has a pilot without canals (+30.8 deg)" in found.sentence("slow_yaw")


def test_force_of_the_leans_stays_along_the_spine_and_hides_the_bank(planned):
    """Its bank is acos(1 / 1.06) = 19.4 deg; it ends level, and only the canals tell a roll."""
    head = planned["leans"]
    time = PERIOD * np.arange(len(head.rotation))
    roll = np.degrees(true_attitude(head)[0])
    force = np.degrees(np.arctan2(head.specific_force[:, 1], head.specific_force[:, 2]))
    assert roll[time < 60].min() == pytest.approx(-19.37, abs=0.05)
    assert np.abs(force).max() < 1.3 and np.abs(roll[time > 63.5]).max() < 0.1
    assert np.abs(np.gradient(roll[time < 60], PERIOD)).max() < 2.5  # Mulder's limit


def test_motion_file_may_name_its_illusion(robot, tmp_path):
    text = find_file("post_roll", "motion").read_text(encoding="utf-8")
    own = tmp_path / "own.yaml"
    own.write_text(text.replace("sign: -1", "sign: 1"), encoding="utf-8")
    found = intended_illusion(str(own), robot, ["slow_yaw"])
    assert found.predicted["slow_yaw"].size == 0 and not found.is_predicted("slow_yaw")
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
