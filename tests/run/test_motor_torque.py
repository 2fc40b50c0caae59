"""What motors give within the periods, against a walk through the loop in small steps."""

import numpy as np
import pytest
from helpers.variants import kind, overruled, weaker
from oracles.small_steps import STEPS, walked
from pydrake.systems.framework import LeafSystem

from sdt_drake.motion import Motion
from sdt_drake.robot.device import Drive
from sdt_drake.run.controllers import Controller, register_controller
from sdt_drake.run.loop import Loop, make_loop
from sdt_drake.run.motor_torque import torque_limits
from sdt_drake.run.simulate import simulate

PERIODS = 20  # 0.1 s of motion


def short_motion():
    """All joints speed up; joint 2 for a while faster than its motor can."""
    t = 0.005 * np.arange(PERIODS + 1)
    v = np.outer(t, [0.45, 3.0, 0.25, 0.4])
    v[8:, 1] += 2.0 * np.minimum((t[8:] - t[8]) / 0.01, 1.0)
    return Motion.from_speeds(0.005, np.array([0.0, 0.3, 0.1, 0.1]), v)


@pytest.fixture
def design_of(designed):
    def make(label, plant, drive, **fields):
        fields |= kind(label) | {"plant.kind": plant, "drive": drive, "accuracy": 1e-6}
        return designed("coupled_pi_ctc", fields, motion=short_motion())

    return make


ENVELOPE = {"n1": [20.0, 0.1, 5.0, 5.0], "n0": [300.0, 4.0, 30.0, 30.0]}
CASES = {
    "p_pi+id": ("p_pi+id", "coupled", Drive(torque_error=[0.1, -0.1, 0.0, 0.05])),
    "envelope": ("pi_id", "coupled", Drive(**ENVELOPE)),
    "late": ("p_pi+id", "coupled", Drive(reference_delay=0.0072)),
    "two periods late": ("p_pi+id", "coupled", Drive(reference_delay=0.01)),
    "lag": ("pi_id", "coupled", Drive(torque_bandwidth=200.0, torque_error=[0.1, -0.1, 0, 0.05])),
    "sampled": ("pi_id", "coupled", Drive(period=0.001, **ENVELOPE)),
}


def agree(design, tolerance=5e-4):
    """Peak, RMS and mean as shares of the motor, and how long it saturates.

    The walk takes the torque for straight in its steps, and saturation for whole halves of them.
    """
    run, (*torques, saturated) = simulate(design), walked(design)
    for torque, wanted in zip((run.tau_peak, run.tau_rms, run.tau_mean), torques, strict=True):
        off = (torque[1:] - wanted) / design.device.simulated.motor_torque_limit
        np.testing.assert_allclose(off, 0, atol=tolerance)
    np.testing.assert_allclose(run.saturated[1:], saturated, rtol=0, atol=0.5 / STEPS + 2e-3)
    return run


@pytest.mark.oracle
@pytest.mark.parametrize("case", CASES)
def test_torque_within_periods_equals_walk_in_small_steps(design_of, case):
    assert np.any(agree(design_of(*CASES[case])).saturated[:, 1] > 0)


@pytest.mark.parametrize("bandwidth", [100.0, 600.0])
def test_lagged_torque_is_as_accurate_as_told(designed, bandwidth):
    """At the default accuracy, against 1e-8."""
    fields = {"drive": Drive(torque_bandwidth=bandwidth)}
    designs = [
        designed("coupled_pi", fields | {"accuracy": accuracy}, start=5.0, end=5.3)
        for accuracy in (1e-4, 1e-8)
    ]
    runs, limit = [simulate(x) for x in designs], designs[0].device.simulated.motor_torque_limit
    for name, promised in {"tau_peak": 3e-3, "tau_mean": 1.5e-3, "tau_rms": 1.5e-3}.items():
        rough, fine = (getattr(run, name) / limit for run in runs)
        np.testing.assert_allclose(rough, fine, rtol=0, atol=promised, err_msg=name)


STRAIGHT = {
    "pi": ("pi", "coupled", Drive()),
    "pi on the error": ("pi", "axis", Drive(torque_error=[0.1, -0.1, 0.0, 0.05])),
    "anti-windup": ("pi_ctc", "axis", Drive()),
    **CASES,
}
OPTIONS = {"pi on the error": {"setpoint_weight": 1}, "anti-windup": {"anti_windup": True}}
STOPS = {"late"}  # in every run


@pytest.mark.parametrize("case", STRAIGHT)
def test_run_without_feedthrough_stops_has_the_same_torques(design_of, monkeypatch, case):
    options = {f"controller.{k}": x for k, x in OPTIONS.get(case, {}).items()}
    design = weaker(design_of(*STRAIGHT[case], **options), 0.5)
    assert (make_loop(design).feedthrough is None) == (case in STOPS)
    straight = simulate(design)
    monkeypatch.setattr(Loop, "feedthrough", None)
    stopping, limit = simulate(design), design.device.simulated.motor_torque_limit
    assert np.any(straight.saturated)
    for name in ("tau_peak", "tau_rms", "saturated"):
        off = getattr(straight, name) - getattr(stopping, name)
        np.testing.assert_allclose(off / limit, 0, atol=1e-9, err_msg=name)


class Given(LeafSystem, Controller):
    """tau_cmd = a + b t + c t², in limits of the motors, whatever the robot does."""

    LIMITS = np.zeros((3, 4))  # a, b, c

    def __init__(self, design):
        super().__init__()
        limit = design.device.simulated.motor_torque_limit

        def command(context, output):
            output.SetFromVector(limit * (context.get_time() ** np.arange(3) @ self.LIMITS))

        self.DeclareVectorOutputPort("tau_cmd", len(limit), command, {self.time_ticket()})


@pytest.mark.parametrize("sign", [1, -1])
def test_mean_rms_and_saturation_of_known_torques_equal_by_hand(design_of, sign):
    """At the limit, just beyond it, on a parabola, and through the limit within a period."""
    x = np.array([[1, 1 + 1e-15, 0, 0.9], [0, 0, 0.8, 0.4], [0, 0, -0.8, 0]])  # of t / period
    limits = sign * x / 0.005 ** np.arange(3)[:, None]
    register_controller("given", type("Own", (Given,), {"LIMITS": limits}))
    own = design_of("given", "coupled", Drive())
    run, limit = simulate(own), own.device.simulated.motor_torque_limit
    np.testing.assert_allclose(run.saturated[1], [0, 1, 0, 1 - 0.1 / 0.4], rtol=1e-9)
    assert not run.saturated[:, 0].any()
    mean, rms = (run.tau_mean[1] / limit)[:3], (run.tau_rms[1] / limit)[:3]
    np.testing.assert_allclose(mean, sign * np.array([1, 1, 0.8 / 6]), rtol=1e-9)
    np.testing.assert_allclose(rms, [1, 1, 0.8 / 30**0.5], rtol=1e-9)


def test_axis_limits_are_widened_by_alleviating_torque(design_of):
    help_ = np.array([[3.0, -2, 0, 1], [-1, 5, 2, 0], [0, 0, 0, 0]])
    axis = design_of("pi", "axis", Drive())
    axis = overruled(axis, loads=axis.loads._replace(alleviating_torque=help_))
    lower, upper = torque_limits(axis, np.arange(2), np.zeros((2, 4)))
    limit = axis.device.simulated.motor_torque_limit
    np.testing.assert_allclose(upper - limit, [[3, 0, 0, 1], [0, 5, 2, 0]], atol=1e-9)
    np.testing.assert_allclose(lower + limit, [[0, -2, 0, 0], [-1, 0, 0, 0]], atol=1e-9)


@pytest.mark.parametrize("period", [None, 0.001])
def test_widened_axis_limits_arrive_with_the_reference(design_of, period):
    # In the middle of a period; the help of the others changes from sample to sample.
    design = weaker(design_of("pi_ctc", "axis", Drive(period=period, reference_delay=0.007)), 0.1)
    assert agree(design, 0.02).saturated.any() and design.loads.alleviating_torque.any()
