"""What drives and anti-windup do to a run: delays, and the time until a motor is back."""

import numpy as np
import pytest
from helpers.variants import kind, overruled
from oracles.by_hand import LIMIT

from sdt_drake.motion import Motion
from sdt_drake.robot.device import Drive
from sdt_drake.robot.dynamics import Loads
from sdt_drake.run.simulate import simulate

PERIOD, HOLD = 0.005, 1.0  # s; rad/s of joint 2
CONSISTENT = {"algorithm": "consistent"}


def test_anti_windup_halves_the_time_back_from_saturation(designed):
    """Joint 2 at constant speed, its motor overloaded by 2 % from 0.1 s to 1.1 s."""
    load, times = np.zeros((701, 4)), []
    load[20:220, 1] = 1.02 * LIMIT[1]
    motion = Motion.from_speeds(PERIOD, np.zeros(4), np.tile([0, HOLD, 0, 0], (701, 1)))
    for anti_windup in (False, True):
        fields = CONSISTENT | kind("pi", anti_windup=anti_windup)
        design = overruled(designed("axis_pi", fields, motion=motion), loads=Loads(load, 0 * load))
        run = simulate(design)
        loaded = (run.time > 0.4) & (run.time <= 1.1)
        assert np.all(run.tau_limited[loaded, 1] < run.tau_cmd[loaded, 1])
        lost = 0.02 * LIMIT[1] / design.i_eff[1]  # rad/s², which the motor cannot hold
        assert run.v[120, 1] - run.v[220, 1] == pytest.approx(lost * 100 * PERIOD, rel=1e-6)
        off = np.abs(run.v[:, 1] - HOLD) > 0.02 * HOLD
        times.append(run.time[np.flatnonzero(off)[-1] + 1] - 1.1)
    assert 0 < times[1] < 0.5 * times[0], times


def test_delay_of_whole_periods_shifts_the_response_by_as_many_samples(designed):
    fields = kind("p_pi") | CONSISTENT
    prompt = simulate(designed("axis_pi", fields, end=0.8, rest=3)).v
    for count in (1, 50):
        drive = {"drive": Drive(reference_delay=count * PERIOD)}
        late = simulate(designed("axis_pi", fields | drive, end=0.8, rest=3)).v
        np.testing.assert_allclose(late[count:], prompt[:-count], atol=2e-6)
        np.testing.assert_allclose(late[:count], 0, atol=1e-12)
        for other in (count - 1, count + 1):  # a sample more or less would show
            assert np.abs(late[other:] - prompt[: len(late) - other]).max() > 1e-3
