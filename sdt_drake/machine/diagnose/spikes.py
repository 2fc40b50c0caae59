"""Spikes of a recording: values that lie far from all around them, as marks of a logger do."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import median_filter

from sdt_drake.io.arrays import Array
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.angles import speed_limit
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.robot import Robot

_UNITS = {"q": "rad", "v": "rad/s", "tau": "N m"}


def without_spikes(recorded: Recorded, robot: Robot) -> Recorded:
    """Replace spikes by a spline through their neighbours, and tell them in the notes.

    A spike is up to three samples that no joint can have: apart from the median around them by

    - 8 times the steps of 95 % of the samples, and
    - a position: twice what the joint turns in a sample at its speed limit; a speed: its limit;
      a torque: three times its limit.
    """
    speed = speed_limit(robot)
    least = {"q": 2 * speed * recorded.period, "v": speed, "tau": 3 * robot.effort_limit}
    signals, notes = dict(recorded.signals), list(recorded.notes)
    for name, values in recorded.signals.items():
        kind = name.partition("_")[0]
        for k in range(robot.n if kind in least else 0):
            bad = _apart(values[:, k]) > least[kind][k]
            if not bad.any():
                continue
            if signals[name] is values:
                signals[name] = values.copy()
            own, known = recorded.time[bad], recorded.time[~bad]
            at = np.clip(own, known[0], known[-1])  # constant beyond the ends
            signals[name][bad, k] = CubicSpline(known, values[~bad, k])(at)
            i = int(bad.argmax())
            notes.append(
                f"{name}_{k + 1}: {bad.sum()} value(s) far from all around, the first "
                f"{values[i, k]:.4g} {_UNITS[kind]} at {own[0]:.4g} s, were replaced"
            )
    return replace(recorded, signals=signals, notes=tuple(notes))


def _apart(values: Array) -> Array:
    """Return the distance of each sample from the median around it; 0 within usual steps."""
    off = np.abs(values - median_filter(values, c.SPIKE_WINDOW, mode="reflect"))
    usual = np.quantile(np.abs(np.diff(values)), c.USUAL_STEPS)
    return np.where(off > c.SPIKE * usual, off, 0.0)
