"""Pilots who differ, and how many of them feel an illusion."""

import numpy as np
import pytest
from test_illusions import held

from sdt_drake.analysis import pilots as module
from sdt_drake.analysis.illusions import PERIOD, feel, illusion_of, illusions, largest_error
from sdt_drake.analysis.pilots import Feeling, differences, draw_pilots, feelings
from sdt_drake.robot.head import head_motion_of_samples
from sdt_drake.systems import load_perception


@pytest.mark.parametrize("name", ["clark2019", "slow_yaw", "rader2009", "irmak2023"])
def test_pilots_differ_as_was_published_and_in_nothing_else(name):
    own, drawn = load_perception(name), draw_pilots(load_perception(name), 3000)
    tau = np.array([pilot.tau for pilot in drawn])
    np.testing.assert_array_equal(tau, np.tile(tau[:, :1], 3))
    assert tau[:, 0].mean() == pytest.approx(5.7, rel=0.01)
    assert tau[:, 0].std() / 5.7 == pytest.approx(0.6 / 4.2, rel=0.05)
    k_w = np.array([pilot.k_w for pilot in drawn])
    assert np.all(k_w[:, :2] == own.k_w[0]) and k_w.min() > 0
    # Felt yaw lasts (k_w + 1) tau; people report 13 to 20 s, evenly, whatever their cupula is like.
    lasts = (k_w[:, 2] + 1) * tau[:, 0] / ((own.k_w[2] + 1) * 5.7)
    np.testing.assert_allclose([lasts.min(), lasts.max()], [13 / 16.5, 20 / 16.5], atol=2e-3)
    assert lasts.std() == pytest.approx(7 / 16.5 / 12**0.5, rel=0.05)
    assert abs(np.corrcoef(lasts, tau[:, 0])[0, 1]) < 0.06
    for field in ("k_fw", "k_fg", "k_a", "tau_a", "cutoff"):
        assert all(getattr(pilot, field) == getattr(own, field) for pilot in drawn)


def test_a_pilot_is_the_same_in_any_crowd():
    own = load_perception("clark2019")
    assert draw_pilots(own, 5) == draw_pilots(own, 20)[:5]
    assert draw_pilots(own, 5) != draw_pilots(own, 5, seed=1)


def turned(robot, rate_deg):
    """The head while the first joint comes to a speed, and holds it for 4 s."""
    time = PERIOD * np.arange(250, dtype=float)
    v = np.radians(rate_deg) * np.minimum(time[:, None], 1) * np.eye(robot.n)[0]
    return head_motion_of_samples(robot, PERIOD, np.cumsum(v, axis=0) * PERIOD, v)


def test_pilots_who_do_not_differ_feel_it_all_or_none(robot, monkeypatch):
    monkeypatch.setattr(
        module,
        "_people",
        lambda: {"cupula": {"mean": 4.2, "deviation": 0}, "yaw": {"range": [16.5, 16.5]}},
    )
    for rate, count in ((0.5, 0), (60, 6)):
        head = turned(robot, rate)
        felt = feel(head, PERIOD, "slow_yaw")
        found = {own.quantity: own for own in feelings(None, head, PERIOD, "slow_yaw", 6)}
        assert found["yaw rate"].count == count
        largest = {one.quantity: abs(one.error) for one in illusions(felt, head)}
        for quantity, own in found.items():
            assert own.count == (6 if quantity in largest else 0)
            assert np.ptp(own.errors) == pytest.approx(0, abs=1e-9)
            if quantity in largest:
                assert abs(own.errors[0]) == pytest.approx(largest[quantity], abs=1e-6)


def test_nobody_feels_anything_at_rest(robot):
    for own in feelings(None, held(robot, [0, 0.3, 0, 0]), PERIOD, "clark2019", 3):
        assert own.count == 0


def test_of_a_training_motion_what_it_is_meant_for_is_counted(robot):
    head = turned(robot, 60)  # its windows begin later: nothing of it is left
    (own,) = feelings(illusion_of("somatogravic"), head, PERIOD, "clark2019", 4, seed=3)
    assert own.quantity == "pitch"
    by_hand = [
        largest_error(feel(head, PERIOD, pilot), head, illusion_of("somatogravic"))
        for pilot in draw_pilots(load_perception("clark2019"), 4, seed=3)
    ]
    np.testing.assert_array_equal(own.errors, by_hand)
    assert np.ptp(by_hand) > 0


@pytest.mark.parametrize(
    ("felt", "told"),
    [
        (168, "168 of 200 pilots (84 %, 95 % interval 78 to 88 %)"),
        (0, "0 of 200 pilots (0 %, 95 % interval 0 to 2 %)"),
        (200, "200 of 200 pilots (100 %, 95 % interval 98 to 100 %)"),
    ],
)
def test_interval_is_wilsons(felt, told):
    """With z = 1.96: (p + z²/2n ± z sqrt(p (1 - p) / n + z²/4n²)) / (1 + z²/n)."""
    errors = np.where(np.arange(200) < felt, -2.0, 1.6)  # of either sign; 1.7 deg is felt
    assert str(Feeling("roll", errors)) == told
    n, p, z = 200, felt / 200, 1.96
    half = z * np.sqrt(p * (1 - p) / n + z**2 / 4 / n**2)
    ends = 100 * (p + z**2 / 2 / n + np.array([-1, 1]) * half) / (1 + z**2 / n)
    assert told.endswith(f"{abs(ends[0]):.0f} to {ends[1]:.0f} %)")


def test_what_does_not_differ_is_told():
    told = differences()
    assert "4.2 ± 0.6 s" in told[0] and "Dai" in told[0] and "13 to 20 s" in told[1]
    assert told[2].startswith("No spread was found of k_w about x and y")
