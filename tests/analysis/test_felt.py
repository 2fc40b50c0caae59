"""The felt difference on motions whose answer is known."""

import numpy as np
import pytest

from sdt_drake.analysis.perception import CHANNELS, FeltDifference, felt_difference
from sdt_drake.robot.head import HeadMotion

H = 0.005
T = H * np.arange(2001)


def motion(rows=2001, **fields):
    zero = np.zeros((rows, 3))
    at_rest = {
        "specific_force": np.tile([0, 0, 9.81], (rows, 1)),
        "angular_velocity": zero,
        "angular_acceleration": zero,
        "position": zero,
        "rotation": np.broadcast_to(np.eye(3), (rows, 3, 3)),
    }
    return HeadMotion(**(at_rest | fields))


@pytest.mark.parametrize(("axis", "threshold"), [(0, 0.063), (1, 0.057), (2, 0.154)])
def test_force_is_in_multiples_of_bensons_thresholds(axis, threshold):
    force = np.tile([0.0, 0, 9.81], (2001, 1))
    force[500:1000, axis] -= 3 * threshold
    force[1500:1600, axis] += 0.9 * threshold
    felt = felt_difference(motion(), motion(specific_force=force), H)

    expected = np.zeros(6)
    expected[3 + axis] = 3
    np.testing.assert_allclose(felt.largest, expected, rtol=1e-9)
    assert felt.share == pytest.approx(500 / 2001)
    assert felt.channel_share[3 + axis] == pytest.approx(500 / 2001)
    assert felt.worst_force == (CHANNELS[3 + axis], pytest.approx(3))
    assert felt.worst_rotation[1] == 0


def test_quick_rotation_counts_by_the_short_detector_and_a_slow_one_by_the_long():
    quick, slow = np.zeros((2, 2001, 3))
    quick[:, 2] = np.radians(3) * np.sin(2 * np.pi * T)
    slow[:, 2] = np.radians(0.3) * 2 * T  # 0.3 deg/s² for 20 s
    largest = [
        felt_difference(motion(), motion(angular_velocity=omega), h).largest[2]
        for omega, h in ((quick, H), (slow, 2 * H))
    ]
    assert largest[0] == pytest.approx(3 / 0.30, rel=0.2)
    assert largest[1] == pytest.approx(0.3 / (0.22 / (1 - np.exp(-20 / 14.5))), rel=1e-6)
    assert largest[1] > 0.3 * 0.70 / 0.30


def test_only_the_difference_counts():
    omega = np.outer(np.sin(T), [1.0, 2, 3])
    off = np.outer(np.sin(5 * T), [0.01, 0.02, 0.03])
    one = felt_difference(
        motion(angular_velocity=omega), motion(angular_velocity=omega + off), H
    ).multiples
    alone = felt_difference(motion(), motion(angular_velocity=off), H).multiples
    np.testing.assert_allclose(one, alone, atol=1e-9)


def test_a_constant_difference_of_rates_is_forgotten():
    """In ten time constants of the long detector."""
    t = H * np.arange(30001)
    omega = np.zeros((len(t), 3))
    omega[1:, 1] = np.radians(20)
    felt = felt_difference(motion(len(t)), motion(len(t), angular_velocity=omega), H)
    assert felt.multiples[1, 1] > 10 and felt.multiples[-1].max() < 0.01


def test_share_counts_time_with_any_channel_above_one():
    multiples = np.zeros((10, 6))
    multiples[:3, 0] = multiples[2:5, 4] = 1.5
    multiples[5:, 2] = 1.0  # just felt is not above
    felt = FeltDifference(multiples)
    assert felt.share == pytest.approx(0.5)
    np.testing.assert_allclose(felt.channel_share, [0.3, 0, 0, 0, 0.3, 0])
