"""A robot that is known, and recordings of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.dynamics import inverse_dynamics

COULOMB_TRUE = np.array([300.0, 60.0, 50.0, 30.0])
VISCOUS_TRUE = np.array([400.0, 16.0, 30.0, 12.0])
PILOT = Deviation(payload_mass=18.0, payload_offset=[0.0, 0.03, 0.0265])
HEAVIER = Deviation(link_scales=[1.08, 1.08, 1.08, 1.08, 1.0])


def motion(robot, seconds=20.0, rate=100.0):
    """Time, q, v, vd of sines in all joints, from the formula."""
    rng = np.random.default_rng(4)
    time = np.arange(0, seconds, 1 / rate)
    omega = 2 * np.pi * np.array([0.1, 0.2, 0.3, 0.5, 0.7])
    size = np.array([0.15, 1.5, 1.0, 1.5])[:, None] * rng.uniform(0.3, 1, (robot.n, 5)) / omega
    angle = omega * time[:, None, None] + rng.uniform(0, 6, (robot.n, 5))
    waves = (np.sin(angle), omega * np.cos(angle), -(omega**2) * np.sin(angle))
    return time, *(0.5 * np.sum(size * wave, axis=2) for wave in waves)


def recorded_of(true, noise=0.01, seed=0, seconds=20.0):
    """A recording of a robot with friction; noise over the RMS of the torque."""
    time, q, v, vd = motion(true, seconds)
    tau = inverse_dynamics(true, q, v, vd) + COULOMB_TRUE * np.sign(v) + VISCOUS_TRUE * v
    rng = np.random.default_rng(seed)
    tau = tau + noise * np.sqrt(np.mean(tau**2, axis=0)) * rng.normal(size=tau.shape)
    return Recorded(Path("truth.csv"), time, {"q": q, "tau": tau})


def true_robot(robot):
    """The device as it is: heavier frames, another pilot."""
    return deviated(deviated(robot, HEAVIER), PILOT)


def changed(recorded, **signals):
    """A recording with other signals."""
    return replace(recorded, signals={**recorded.signals, **signals})
