"""Gains against Table 1 and the roots of Eq. 5."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sdt_drake.systems.gains import damping_ratio, natural_frequency, oscillation_frequency, tune

OMEGA_R = 65.991  # rad/s = 10.5028 Hz
I_EFF_MAX = np.array([4.26, 98.01, 796.3, 250.28])  # kg m², Table 1
ZETA = np.array([0.95, 0.98, 0.99, 0.95])
VARIATION = np.array([39.95, 31.82, 7.29, 25.4])  # %
# As printed; K_IS of joint 4 is printed as 2.73e5, but 0.25 * 65.991² * 250.28 = 2.7248e5.
KP_PRINTED = ("2.671e+02", "6.34e+03", "5.2e+04", "1.57e+04")
KI_PRINTED = ("4.64e+03", "1.07e+05", "8.67e+05", "2.72e+05")


def test_gains_and_damping_equal_table_1():
    gains = tune(I_EFF_MAX, OMEGA_R, ZETA)
    for values, texts in ((gains.kp, KP_PRINTED), (gains.ki, KI_PRINTED)):
        for value, text in zip(values, texts, strict=True):
            assert f"{value:.{len(text.partition('e')[0].partition('.')[2])}e}" == text
    # The paper cuts the last digit of some of them off, hence the tolerance.
    damping = damping_ratio(gains, I_EFF_MAX * (1 - VARIATION / 100))
    np.testing.assert_allclose(damping, [1.23, 1.18, 1.03, 1.099], rtol=0, atol=0.01)
    share = oscillation_frequency(gains, I_EFF_MAX) / natural_frequency(gains, I_EFF_MAX)
    np.testing.assert_allclose(share[0], 0.312, rtol=0, atol=5e-4)  # not 0.32, as printed


POSITIVE = st.floats(1e-2, 1e3)


@given(POSITIVE, POSITIVE, st.floats(0.1, 3), st.floats(0.1, 2), st.floats(0.1, 5))
def test_frequencies_and_damping_are_those_of_the_roots(i_max, omega_r, zeta, ratio, share):
    """Those of s² + K_PS / I s + K_IS / I, at the largest inertia and at a share of it."""
    gains, i_eff = tune([i_max], omega_r, zeta, ratio), share * i_max
    assert natural_frequency(gains, [i_max]) == pytest.approx(ratio * omega_r, rel=1e-12)
    assert damping_ratio(gains, [i_max]) == pytest.approx(zeta, rel=1e-12)
    roots = np.roots([1, gains.kp[0] / i_eff, gains.ki[0] / i_eff])
    omega_n, sigma = np.sqrt(np.prod(roots).real), -roots.real.sum() / 2
    assert natural_frequency(gains, [i_eff]) == pytest.approx(omega_n, rel=1e-9)
    assert damping_ratio(gains, [i_eff]) == pytest.approx(sigma / omega_n, rel=1e-9)
    turns = np.abs(roots.imag).max()
    assert oscillation_frequency(gains, [i_eff]) == pytest.approx(turns, abs=1e-6 * omega_n)
