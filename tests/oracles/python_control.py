"""PI speed loops in python-control.

Independent: processes are matrices that are written down, controllers transfer functions;
python-control samples, closes and cuts them. The package evaluates its own linearised Drake
diagrams.
"""

import control
import numpy as np

from oracles.two_mass import two_masses


def process(inertia, rotor, viscous, lag, error, springs, encoder):
    """From the command to speed and angle of the encoder and speed of the link, motor side."""
    A, B = np.array([[0.0, 1], [0, 0]]), np.array([[0], [1 / inertia]])
    if springs:
        A, B = two_masses(rotor, inertia - rotor, *springs)
    A[1, 1] -= viscous / (inertia - rotor if springs else inertia)
    n = len(A)
    if lag:
        A = np.block([[A, B], [np.zeros(n), -2 * np.pi * lag]])
        B = np.eye(n + 1)[:, n:] * 2 * np.pi * lag
    at = n - 2 if encoder == "motor" else 0
    return control.ss(A, (1 + error) * B, np.eye(len(A))[[at + 1, at, 1]], 0)


def pi_loop(P, kp, ki, weight, period, by_differences):
    """Cut and closed loop around a process: from the error to the measured speed, and from the
    speed asked for to that of the link. `by_differences`, the speed is one of positions."""
    integral = control.tf([ki], [1, 0])
    if period:
        P = control.sample_system(P, period, "zoh")
        integral = control.tf([ki * period], [1, -1], period)
    speed = control.tf([1, -1], [period, 0], period) * P[1, 0] if by_differences else P[0, 0]
    loop, ahead = control.ss(kp + integral) * speed, control.ss(weight * kp + integral)
    return loop, P[2, 0] * ahead * control.feedback(1, loop)


def crossings_of(gain, omega, period):
    """Gains and phase margins [deg] at which a loop comes to its limit, and where it crosses 1."""
    cut = control.stability_margins(control.frd(gain, omega), returnall=True)
    gains, angles, _, _, crossings, _ = cut
    if period and gain[-1].real < 0:
        gains = np.append(gains, 1 / np.abs(gain[-1]))  # at the Nyquist frequency
    return gains, angles, crossings
