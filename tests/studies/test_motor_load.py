"""Heat and torque of motors against closed forms, long simulations, and the plan."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from small_studies import MOTION

from sdt_drake.io.resources import models_dir
from sdt_drake.robot.device import Drive
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import Scenario, load_scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.studies.outcomes import (
    has_motor_loads,
    motor_load_names,
    motor_loads,
    winding_temperature,
)

FITTED = ["AC-203", "TM-3950", "TM-2150", "TM-2150"]
PERIOD = 0.005  # s


@pytest.mark.parametrize("T", [0.5, 50.0])
def test_on_and_off_by_hand(T):
    """u (1 - exp(-t_c / T)) / (1 - exp(-(t_c + t_p) / T)), at the end of the load."""
    on, off = 6.0, 14.0
    by_hand = 1.5**2 * (1 - np.exp(-on / T)) / (1 - np.exp(-(on + off) / T))
    load = np.full((1200, 1), 1.5)
    assert winding_temperature(load**2, [T], PERIOD, off)[0] == pytest.approx(by_hand, rel=1e-9)
    with_rest = np.vstack([load, np.zeros((2800, 1))])  # the same pause in the motion
    assert winding_temperature(with_rest**2, [T], PERIOD)[0] == pytest.approx(by_hand, rel=1e-9)


@pytest.fixture
def run(desk):
    """A design of half a second of joint 2 on motors of the catalogue, its run, what it takes."""

    def run_(knots: str, *motors: str):
        text = MOTION.replace("[0.25, {speed}], [0.5, {speed}]", knots)
        (desk / "short.yaml").write_text(text.format(speed=0.0))
        scenario = load_scenario("coupled.yaml")
        scenario.planner, scenario.controller.kind = "retiming", "pi_id"
        scenario.device = DeviceChoice([*motors], fitted=[*FITTED])
        own = make_design(scenario)
        recording = simulate(own)
        loads = [motor_loads(own, recording, 0.5, pause) for pause in (0.0, 120.0)]
        return own, recording, *(dict(zip(motor_load_names(4), x, strict=True)) for x in loads)

    return run_


def test_loads_of_a_run(run):
    own, recording, loads, rested = run("[0.25, 1], [0.5, 1]")
    duration = own.motion.duration
    assert loads["used_torque_share_2"] == pytest.approx(recording.tau_peak[:, 1].max() / 3950)
    rms = np.sqrt(np.mean(recording.tau_rms[1:, 1] ** 2))
    assert loads["rated_torque_share_2"] == pytest.approx(rms / 1780)
    less = np.sqrt(duration / (duration + 120))
    assert rested["rated_torque_share_2"] == pytest.approx(less * rms / 1780)
    mean = loads["rated_torque_share_2"] ** 2
    assert mean < loads["winding_temperature_2"] < 1.02 * mean  # the peak of a slow winding
    assert rested["winding_temperature_2"] < loads["winding_temperature_2"]
    # Slower than n1 there is the peak torque.
    mean = recording.tau_rms[:, 1].max() / 3950
    assert loads["torque_at_speed_share_2"] == pytest.approx(mean, rel=0.02)
    assert loads["stretch"] == 0


SLOW = "{id: SLOW, kind: torque motor, peak_torque: 3950, rated_torque: 1780, rotor_inertia: 8.6"


def slow_motors(desk, **speeds: float) -> DeviceChoice:
    """The shipped motors, but one for joint 2 with other speeds [rpm]."""
    told = "".join(f", {name}: {value!r}" for name, value in speeds.items())
    own = f"  - {SLOW}{told}, mass: 560, thermal_time_constant: 900, source: made up}}\n"
    (desk / "own.yaml").write_text((models_dir() / "motors.yaml").read_text() + own)
    return DeviceChoice(["", "SLOW", "", ""], fitted=[*FITTED], catalogue="own.yaml")


def test_chosen_motors_limit_planner_and_loop_as_the_same_numbers_of_the_drive_do(run, desk):
    own, *_ = run("[0.25, 1], [0.5, 0]")
    scenario, rpm = own.scenario, np.pi / 30
    scenario.plant.friction.coulomb = [0, 600.0, 0, 0]  # the planner does not know it
    scenario.device = slow_motors(desk, n1_rpm=0.25 / rpm, n0_rpm=1.02 / rpm)
    chosen = make_design(scenario)
    assert chosen.envelope.source == "the motors of the catalogue (AC-203, SLOW, TM-2150, TM-2150)"
    first = simulate(chosen)
    given, without = copy.deepcopy(scenario), slow_motors(desk)
    given.device, n1, n0 = without, [*chosen.envelope.n1], [*chosen.envelope.n0]
    given.drive = Drive(n1=n1, n0=n0)
    second = make_design(given)
    assert second.envelope.source.startswith("drive.n1 and drive.n0, instead of the motors of the")
    assert first.saturated[:, 1].any() and first.v[:, 1].max() > 0.6
    for name, values in vars(simulate(second)).items():
        np.testing.assert_array_equal(values, getattr(first, name), err_msg=name)
    loads = [motor_loads(x, first, 0.5) for x in (chosen, second)]
    assert loads[0] == loads[1]
    given.drive = Drive()
    free = make_design(given)
    assert "without any: joint 2, no n1_rpm and n0_rpm" in free.envelope.source
    assert simulate(free).saturated[:, 1].max() == 0


def test_what_has_motor_loads():
    """A robot whose masses contain no motors, too, if each joint has one of the catalogue."""
    scenario = Scenario(device=DeviceChoice([*FITTED], fitted=[""] * 4))
    assert not has_motor_loads(scenario)  # an axis plant
    scenario.plant.kind = "coupled"
    assert has_motor_loads(scenario)
    scenario.device.motors[3] = ""
    assert not has_motor_loads(scenario)
    scenario.device = DeviceChoice()
    assert not has_motor_loads(scenario)
