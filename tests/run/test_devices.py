"""Controllers and drives in the loops, against calculations by hand."""

import numpy as np
import pytest
from by_hand import LIMIT
from variants import kind, overruled

from sdt_drake.motion import Motion
from sdt_drake.robot.dynamics import Loads
from sdt_drake.run.simulate import simulate

PERIOD = 0.005  # s
CONSISTENT = {"algorithm": "consistent"}


def same(actual, expected, tolerance):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance)


HOLD = 1.0  # rad/s of joint 2


@pytest.mark.parametrize("structure", ["pi", "p_in_feedback"])
def test_anti_windup_is_back_in_less_than_half_the_time(designed, structure):
    """Joint 2 at constant speed, its motor overloaded by 2 % from 0.5 s to 2.5 s."""
    load, runs = np.zeros((1601, 4)), []
    load[100:500, 1] = 1.02 * LIMIT[1]
    motion = Motion.from_speeds(PERIOD, np.zeros(4), np.tile([0, HOLD, 0, 0], (1601, 1)))
    for anti_windup in (False, True):
        fields = CONSISTENT | kind("pi", structure=structure, anti_windup=anti_windup)
        design = designed("axis_pi", fields, motion=motion)
        runs.append(simulate(overruled(design, loads=Loads(load, 0 * load))))
    times = []
    for recording in runs:
        rows = (recording.time > 0.8) & (recording.time <= 2.5)
        assert np.all(recording.tau[rows, 1] != recording.tau_cmd[rows, 1])
        same(recording.v[500, 1], runs[1].v[500, 1], 0.02)  # as fast when it is released
        off = np.abs(recording.v[:, 1] - HOLD) > 0.02 * HOLD
        times.append(recording.time[np.flatnonzero(off)[-1] + 1] - 2.5)
    assert times[1] < 0.5 * times[0], times
