"""References that arrive late: the loop takes them as those in time, only later."""

from fractions import Fraction

import numpy as np
import pytest
from helpers.variants import kind
from pydrake.systems.primitives import ZeroOrderHold

from sdt_drake.motion import Motion
from sdt_drake.robot.device import Drive
from sdt_drake.run.loop import make_loop
from sdt_drake.run.recording import RECORDED_COLUMNS
from sdt_drake.run.simulate import simulate
from sdt_drake.systems.wiring import systems_in


def there_and_back(period=0.005):
    """All joints turn and stop, and rest at the end for longer than any delay here."""
    t = np.arange(round(0.8 / period) + 1) * period
    turning = np.where(t < 0.6, np.sin(np.pi * t / 0.6) ** 2, 0.0)
    v = np.outer(turning, [0.04, 0.3, 0.2, 0.3])
    return Motion.from_speeds(period, [0.0, 0.3, 0.1, 0.1], v)


@pytest.mark.parametrize("period", [None, 0.001, 0.005])
@pytest.mark.parametrize("label", ["p_pi", "p_pi+id", "inverse_dynamics"])
def test_late_reference_has_torques_of_one_in_time(designed, label, period):
    def run(delay):
        fields = kind(label) | {"drive": Drive(period=period, reference_delay=delay)}
        design = designed("coupled_pi", fields, motion=there_and_back())
        run, limit = simulate(design), design.device.simulated.motor_torque_limit
        rms = np.sqrt(np.mean(run.tau_rms[1:] ** 2, axis=0))
        return np.array([run.tau_peak.max(axis=0), rms]) / limit, run.saturated

    in_time, saturated = run(0.0)
    assert np.all(in_time[0] > 0.01) and not saturated.any()
    for delay in (0.0004, 0.0025, 0.0123):
        late, saturated = run(delay)
        np.testing.assert_allclose(late, in_time, atol=1e-3)
        assert not saturated.any()


def test_drive_takes_reference_at_its_next_sample(designed):
    def run(delay):
        fields = kind("p_pi+id") | {"drive": Drive(period=0.001, reference_delay=delay)}
        return simulate(designed("coupled_pi", fields, motion=there_and_back()))

    between, at, next_ = run(0.0004), run(0.001), run(0.0011)
    for name in RECORDED_COLUMNS:
        assert getattr(between, name).tobytes() == getattr(at, name).tobytes(), name
    assert not np.array_equal(next_.q, at.q)


@pytest.mark.parametrize("delay", [0.0, 0.0004, 0.0017, 0.005, 0.0123])
@pytest.mark.parametrize(("period", "samples"), [(0.005, 5), (0.005, 16), (1 / 300, 3), (0.007, 7)])
def test_update_instants_agree_to_the_last_bit(designed, period, samples, delay):
    """An update one bit later would see what one at the same instant does not."""
    drive = Drive(period=period / samples, reference_delay=delay, encoder_resolution=[1e6] * 4)
    fields = kind("p_pi+id") | {"period": period, "drive": drive}
    design = designed("coupled_pi", fields, motion=there_and_back(period))
    timing = {
        (x.offset_sec(), x.period_sec())
        for hold in systems_in(make_loop(design).diagram)
        if isinstance(hold, ZeroOrderHold)
        for x in [hold.GetUniquePeriodicDiscreteUpdateAttribute()]
    }
    step = design.drive.period
    offset, held = max(timing, key=lambda x: x[1])
    assert timing == {(0.0, step), (offset, held)}
    assert 0 <= Fraction(offset) < Fraction(held) == samples * Fraction(step)
    assert (Fraction(offset) / Fraction(step)).denominator == 1
    for k in (1, 17, 123_457):
        assert Fraction(offset + k * held) == Fraction(offset) + k * Fraction(held)
    wait = design.drive.reference_delay - delay  # until the drives' next sample
    assert -1e-6 * step <= wait < step
