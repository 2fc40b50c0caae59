"""Effective inertia: Eq. 3, and the numbers of the independent calculation."""

from __future__ import annotations

import numpy as np
import pytest

from sdt_drake.dynamics import InertiaRange, effective_inertia, where_largest


def to_printed_digits(values, printed: str) -> list[str]:
    """`values` as text with as many decimals as each of the `printed` numbers."""
    return [
        f"{value:.{len(text.partition('.')[2])}f}"
        for value, text in zip(values, printed.split(), strict=True)
    ]


@pytest.mark.parametrize(
    "quantity, printed",
    [
        ("maximum", "4.2601 98.0127 796.298 250.280"),
        ("median", "4.004 77.61 792.10 250.28"),
        ("minimum", "3.830 66.82 774.84 250.28"),
        ("variation_percent", "10.09 31.82 2.69 0"),
    ],
)
def test_range_along_the_reference_motion_is_that_of_the_independent_calculation(
    design, quantity, printed
):
    values = getattr(design.inertia, quantity)
    assert to_printed_digits(values, printed) == printed.split()


def test_largest_coupling_torques_are_those_of_the_independent_calculation(design):
    largest = np.max(np.abs(design.torques.coupled), axis=0)
    assert to_printed_digits(largest, "4031 3419 678 288") == ["4031", "3419", "678", "288"]


def test_effective_inertia_is_on_the_motor_side(robot):
    # Eq. 3 by hand: 0.1291 + 18654.8 / 67.2² = 4.26007; direct drives add their rotor.
    i_eff = effective_inertia(robot, [[18654.8, 96.28, 795.769, 249.749], [0, 0, 0, 0]])
    np.testing.assert_allclose(i_eff[0], [4.26007, 98.01, 796.3, 250.28], rtol=1e-6)
    np.testing.assert_array_equal(i_eff[1], [0.1291, 1.73, 0.531, 0.531])


def test_range_of_a_few_samples_is_the_one_computed_by_hand():
    inertia = InertiaRange.of([[4.0, 7.0], [1.0, 7.0], [2.0, 7.0], [1.0, 7.0]])
    np.testing.assert_array_equal(inertia.maximum, [4, 7])
    np.testing.assert_array_equal(inertia.median, [1.5, 7])
    np.testing.assert_array_equal(inertia.minimum, [1, 7])
    np.testing.assert_array_equal(inertia.variation_percent, [75, 0])


def test_the_largest_inertia_is_taken_first_in_time_round_off_apart():
    d_kk = np.array([[1.0, 2.0], [3.0, 2.0 * (1 + 1e-15)], [3.0 * (1 + 1e-14), 2.0], [2.9, 1.0]])
    assert where_largest(d_kk).tolist() == [1, 0]
