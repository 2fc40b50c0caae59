"""The speed loop of an axis by formulas of second order.

Independent: steps, overshoot and settling time follow from the two poles in closed form. Nothing is
simulated, and nothing of the package is used.
"""

import numpy as np


class Formula:
    """The loop I dv/dt = K_IS int(v_ref - v) dt + K_PS (b v_ref - v) - load of an axis, by hand.

    Its poles are -sigma ± beta; C and S are cosh(beta t) and sinh(beta t) / beta, whether beta is
    real (zeta > 1) or imaginary. b is the set-point weight.
    """

    def __init__(self, i_eff, kp, ki):
        self.i_eff = i_eff
        self.omega, self.zeta = np.sqrt(ki / i_eff), kp / (2 * np.sqrt(i_eff * ki))
        self.sigma = self.zeta * self.omega
        self.beta = self.omega * np.sqrt(complex(self.zeta**2 - 1))

    def _parts(self, t):
        sinh = np.sinh(self.beta * t) / self.beta
        return np.exp(-self.sigma * t), np.cosh(self.beta * t).real, sinh.real

    def reference_step(self, b, t):
        decay, C, S = self._parts(t)
        return 1 - decay * (C + (1 - 2 * b) * self.sigma * S)

    def load_step(self, t):
        decay, _, S = self._parts(t)
        return -decay * S / self.i_eff

    def overshoot_percent(self, b):
        if b == 1:  # where dv/dt = 0: at 2 artanh(beta / sigma) / beta
            peak = (2 * np.arctanh(self.beta / self.sigma) / self.beta).real
            return 100 * (self.reference_step(b, peak) - 1)
        below = min(self.zeta, 1 - 1e-12)
        return 100 * np.exp(-np.pi * below / np.sqrt(1 - below**2))

    def times(self, b):
        """Rise time, from 10 to 90 %, and settling time to 2 % [s]: crossings on a fine grid."""
        t = np.linspace(0, 0.6, 60_001)
        v = self.reference_step(b, t)
        first = [t[np.argmax(v >= level)] for level in (0.1, 0.9)]
        return first[1] - first[0], t[np.flatnonzero(abs(v - 1) > 0.02)[-1]]
