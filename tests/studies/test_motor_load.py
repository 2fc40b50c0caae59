"""Heat and torque of motors against closed forms, long simulations, and the plan."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.design import make_design
from sdt_drake.device import DeviceChoice
from sdt_drake.errors import InputError
from sdt_drake.scenario import Scenario
from sdt_drake.simulate import simulate
from sdt_drake.studies.motor_load import (
    has_motor_loads,
    motor_load_names,
    motor_loads,
    winding_temperature,
)

FITTED = ["AC-203", "TM-3950", "TM-2150", "TM-2150"]
PERIOD = 0.005  # s


def test_rated_torque_gives_the_rated_temperature():
    share = np.tile([1.0, 0.5, -2.0], (1000, 1))
    peak = winding_temperature(share**2, [10.0, 180.0, 2700.0], PERIOD)
    np.testing.assert_allclose(peak, [1, 0.25, 4], rtol=1e-9)


@pytest.mark.parametrize("T", [0.5, 5.0, 50.0])
def test_on_and_off_by_hand(T):
    """u (1 - exp(-t_c / T)) / (1 - exp(-(t_c + t_p) / T)), at the end of the load."""
    on, off = 6.0, 14.0
    by_hand = 1.5**2 * (1 - np.exp(-on / T)) / (1 - np.exp(-(on + off) / T))
    load = np.full((1200, 1), 1.5)
    assert winding_temperature(load**2, [T], PERIOD, off)[0] == pytest.approx(by_hand, rel=1e-9)
    with_rest = np.vstack([load, np.zeros((2800, 1))])  # the same pause in the motion
    assert winding_temperature(with_rest**2, [T], PERIOD)[0] == pytest.approx(by_hand, rel=1e-9)


@pytest.mark.parametrize("T", [0.3, 3.0, 30.0])
def test_a_cycle_that_goes_on_for_ever_is_many_cycles(T):
    share = np.random.default_rng(2).normal(size=(400, 2))
    theta, peak = np.zeros(2), np.zeros(2)
    for _ in range(200):
        peak[:] = theta
        for u in share**2:
            theta = u + (theta - u) * np.exp(-0.01 / T)
            peak = np.maximum(peak, theta)
        theta = theta * np.exp(-1.0 / T)
    found = winding_temperature(share**2, [T, T], 0.01, 1.0)
    np.testing.assert_allclose(found, peak, rtol=1e-9)


def test_a_slow_winding_takes_the_mean():
    share = np.random.default_rng(3).normal(size=(500, 1))
    mean = np.mean(share**2) * 2.5 / (2.5 + 10)
    assert winding_temperature(share**2, [1e6], PERIOD, 10.0)[0] == pytest.approx(mean, rel=1e-5)


@pytest.fixture(scope="module")
def run():
    """A design of a device and its run, by controller and motion, each once."""
    done = {}

    def run_(design, label, motion, **device):
        key = label, motion, str(device)
        if key not in done:
            scenario = with_controller(design.scenario, label)
            scenario.motion, scenario.planner = motion, "retiming"
            scenario.device = DeviceChoice(fitted=FITTED, **device)
            own = make_design(scenario)
            done[key] = own, simulate(own)
        return done[key]

    return run_


def named_loads(design, recording, commanded, pause=0.0):
    values = motor_loads(design, recording, commanded, pause)
    return dict(zip(motor_load_names(design.robot.n), values, strict=True))


def test_loads_of_a_run(design, run):
    own, recording = run(design, "pi_id", "post_roll")
    duration = own.motion.duration
    loads, rested = (named_loads(own, recording, duration, pause) for pause in (0.0, 120.0))
    assert loads["used_torque_share_2"] == pytest.approx(recording.tau_peak[:, 1].max() / 3950)
    rms = np.sqrt(np.mean(recording.tau_rms[1:, 1] ** 2))
    assert loads["rated_torque_share_2"] == pytest.approx(rms / 1780)
    less = np.sqrt(duration / (duration + 120))
    assert rested["rated_torque_share_2"] == pytest.approx(less * rms / 1780)
    assert loads["winding_temperature_2"] > loads["rated_torque_share_2"] ** 2  # the peak of it
    assert rested["winding_temperature_2"] < loads["winding_temperature_2"]
    # Slower than n1 = 45 rpm there is the peak torque.
    limits = [loads[f"torque_at_speed_share_{k}"] for k in (1, 2)]
    mean = recording.tau_rms[:, 1].max() / 3950
    assert limits[1] == pytest.approx(mean, rel=0.01)
    assert loads["used_torque_share_2"] > mean  # K_PS times a period's acceleration, at its start
    assert loads["stretch"] == 0


def test_a_weak_motor_stretches_the_motion(design, run):
    own, recording = run(design, "pi_id", "inversion", motors=["AC-100", "", "", ""])
    loads = named_loads(own, recording, 60.0)
    assert loads["stretch"] == pytest.approx(own.motion.duration / 60.0 - 1)  # 60 s in its file
    assert loads["stretch"] > 0.001
    assert loads["used_torque_share_1"] == pytest.approx(1, abs=0.01)
    assert loads["used_torque_share_1"] <= 1


def test_motors_of_no_catalogue_are_refused(design, run):
    own, recording = run(design, "pi_id", "post_roll")
    other = copy.copy(own)
    scenario = copy.deepcopy(own.scenario)
    object.__setattr__(other, "scenario", scenario)
    scenario.device = DeviceChoice(fitted=[*FITTED[:3], ""])
    with pytest.raises(InputError, match=r"^device: joint 4 has no motor of the catalogue"):
        motor_loads(other, recording, 60.0)
    assert not has_motor_loads(scenario)
    scenario.device = DeviceChoice()
    assert not has_motor_loads(scenario)
    assert has_motor_loads(own.scenario)


def test_a_robot_whose_masses_contain_no_motors_has_motor_loads():
    """As long as each joint has one of the catalogue."""
    scenario = Scenario(device=DeviceChoice(FITTED, fitted=[""] * 4))
    scenario.plant.kind = "coupled"
    assert has_motor_loads(scenario)
    scenario.device.motors[3] = ""
    assert not has_motor_loads(scenario)
    scenario.device = DeviceChoice()
    assert not has_motor_loads(scenario)
