"""Gains against Table 1, and damping and frequencies against the roots of Eq. 5."""

import numpy as np
import pytest

from sdt_drake.control import (
    SpeedGains,
    damping_ratio,
    natural_frequency,
    oscillation_frequency,
    tune,
)
from sdt_drake.errors import InputError

OMEGA_R = 65.991  # rad/s = 10.5028 Hz
I_EFF_MAX = np.array([4.26, 98.01, 796.3, 250.28])  # kg m², Table 1
ZETA = np.array([0.95, 0.98, 0.99, 0.95])
VARIATION = np.array([39.95, 31.82, 7.29, 25.4])  # %
# As printed; K_IS of joint 4 is printed as 2.73e5, but 0.25 * 65.991² * 250.28 = 2.7248e5.
KP_PRINTED = ("2.671e+02", "6.34e+03", "5.2e+04", "1.57e+04")
KI_PRINTED = ("4.64e+03", "1.07e+05", "8.67e+05", "2.72e+05")


def printed(value, like):
    """`value` with as many digits as the text `like`."""
    return f"{value:.{len(like.partition('e')[0].partition('.')[2])}e}"


@pytest.fixture
def gains():
    return tune(I_EFF_MAX, OMEGA_R, ZETA)


@pytest.mark.parametrize("k", range(4))
def test_gains_of_table_1(gains, k):
    assert printed(gains.kp[k], KP_PRINTED[k]) == KP_PRINTED[k]
    assert printed(gains.ki[k], KI_PRINTED[k]) == KI_PRINTED[k]


def test_natural_frequency_is_half_the_structure_at_the_largest_inertia(gains):
    np.testing.assert_allclose(natural_frequency(gains, I_EFF_MAX), OMEGA_R / 2, rtol=1e-12)
    assert np.all(natural_frequency(gains, 0.9 * I_EFF_MAX) > OMEGA_R / 2)


def test_damping_of_table_1(gains):
    """The paper cuts the last digit of some of them off, hence the tolerance."""
    smallest = I_EFF_MAX * (1 - VARIATION / 100)
    np.testing.assert_allclose(damping_ratio(gains, I_EFF_MAX), ZETA, rtol=1e-12)
    np.testing.assert_allclose(
        damping_ratio(gains, smallest), [1.23, 1.18, 1.03, 1.099], rtol=0, atol=0.01
    )


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95, 1.0, 1.7, 4.0])
def test_damping_and_frequencies_against_the_roots(gains, share):
    i_eff = share * I_EFF_MAX
    for k in range(4):
        roots = np.roots([1, gains.kp[k] / i_eff[k], gains.ki[k] / i_eff[k]])
        omega_n = np.sqrt(np.prod(roots).real)
        assert natural_frequency(gains, i_eff)[k] == pytest.approx(omega_n, rel=1e-9)
        assert damping_ratio(gains, i_eff)[k] == pytest.approx(
            -roots.real.sum() / 2 / omega_n, rel=1e-9
        )
        assert oscillation_frequency(gains, i_eff)[k] == pytest.approx(
            np.abs(roots.imag).max(), rel=1e-7, abs=1e-9
        )


def test_oscillation_frequency_at_0_95_is_0_312_not_0_32():
    gains = tune([4.26], OMEGA_R, [0.95])
    share = oscillation_frequency(gains, [4.26]) / natural_frequency(gains, [4.26])
    np.testing.assert_allclose(share, 0.312, rtol=0, atol=5e-4)


def test_one_damping_for_all_and_gains_by_hand():
    gains = tune([1.0, 4.0], 2.0, 1.0)  # omega_n = 1
    np.testing.assert_allclose(gains.ki, [1, 4])
    np.testing.assert_allclose(gains.kp, [2, 8])
    by_hand = SpeedGains(kp=np.array([6.0]), ki=np.array([9.0]))
    assert natural_frequency(by_hand, [4.0]) == pytest.approx(1.5)
    assert damping_ratio(by_hand, [4.0]) == pytest.approx(0.5)


def test_gains_that_are_no_numbers_are_refused():
    with pytest.raises(InputError, match="too small"):
        tune([1.0], 1e-170, 1.0)
    with pytest.raises(InputError, match="too large"):
        tune([1.0], 1e170, 1.0)


def test_omega_ratio_is_omega_n_over_omega_r():
    for ratio in (0.1, 0.5, 1.3):
        gains = tune(I_EFF_MAX, OMEGA_R, ZETA, ratio)
        np.testing.assert_allclose(natural_frequency(gains, I_EFF_MAX), ratio * OMEGA_R, rtol=1e-12)
        np.testing.assert_allclose(damping_ratio(gains, I_EFF_MAX), ZETA, rtol=1e-12)
