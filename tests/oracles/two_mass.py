"""An axis with a spring, and PI loops around it, as matrices that are written down.

Independent: the equations of motion of two masses and of a cascade are typed in here as A and B,
and carried over a period by the matrix exponential. The package linearises Drake diagrams by
automatic differentiation and knows neither these matrices nor their order.
"""

import numpy as np
from scipy.linalg import expm


def held(A, B, period):
    """The map of x' = A x + B u over a period with u held."""
    n, m = B.shape
    both = expm(period * np.block([[A, B], [np.zeros((m, n + m))]]))
    return both[:n, :n], both[:n, n:]


def two_masses(rotor, link, omega_r, damping_ratio=0.01):
    """Of an elastic axis, motor side: A and B of [q, v, theta, w]' and of the torque."""
    k, c = omega_r**2 * link, 2 * damping_ratio * omega_r * link
    A = np.zeros((4, 4))
    A[0, 1] = A[2, 3] = 1
    A[1] = np.array([-k, -c, k, c]) / link
    A[3] = np.array([k, c, -k, -c]) / rotor
    return A, np.array([[0], [0], [0], [1 / rotor]])


def cascade_map(A, B, seen, gains, period, drive=None):
    """PI speed loops with both gains on the error around x' = A x + B tau: the map of [x, integral]
    over a period, and what adds the speed that is asked for, held; sampled every `drive` [s].

    `seen` is the measured speed in x; gains are (kp, ki), matrices of the torque over the speed.
    """
    (kp, ki), n, m = gains, *B.shape
    if drive is None:
        one = np.block([[A - B @ kp @ seen, B @ ki], [-seen, np.zeros((m, m))]])
        return held(one, np.vstack([B @ kp, np.eye(m)]), period)
    a, b = held(A, B, drive)
    one = np.block([[a - b @ kp @ seen, b @ ki], [-drive * seen, np.eye(m)]])
    into = np.vstack([b @ kp, drive * np.eye(m)])
    whole, added = np.eye(n + m), np.zeros((n + m, m))
    for _ in range(round(period / drive)):
        whole, added = one @ whole, one @ added + into
    return whole, added
