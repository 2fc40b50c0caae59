"""Heat and torque of motors against closed forms, long simulations, and the plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from command_line import SHORT

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
def designed(desk):
    """A design of half a second of joint 2 on motors of the catalogue."""

    def make(knots: str):
        (desk / "short.yaml").write_text(SHORT.replace("[0.25, 0.5], [0.5, 0.5]", knots))
        scenario = load_scenario("coupled.yaml")
        scenario.planner, scenario.controller.kind = "retiming", "pi_id"
        scenario.device = DeviceChoice(fitted=[*FITTED])
        return make_design(scenario)

    return make


def test_loads_of_a_run(designed):
    design = designed("[0.25, 1], [0.5, 1]")
    run, duration = simulate(design), design.motion.duration
    loads, rested = (
        dict(zip(motor_load_names(4), motor_loads(design, run, 0.5, pause), strict=True))
        for pause in (0.0, 120.0)
    )
    assert loads["used_torque_share_2"] == pytest.approx(run.tau_peak[:, 1].max() / 3950)
    rms = np.sqrt(np.mean(run.tau_rms[1:, 1] ** 2)) / 1780
    assert loads["rated_torque_share_2"] == pytest.approx(rms)
    less = np.sqrt(duration / (duration + 120))
    assert rested["rated_torque_share_2"] == pytest.approx(less * rms)
    # The peak of a slow winding is hardly above its mean.
    assert rms**2 < loads["winding_temperature_2"] < 1.02 * rms**2
    assert rested["winding_temperature_2"] < loads["winding_temperature_2"]
    # Slower than n1 there is the peak torque.
    planned = run.tau_rms[:, 1].max() / 3950
    assert loads["torque_at_speed_share_2"] == pytest.approx(planned, rel=0.02)
    assert loads["stretch"] == 0


MOTOR = """\
  - {id: SLOW, kind: torque motor, peak_torque: 3950, rated_torque: 1780, rotor_inertia: 8.6, \
mass: 560, thermal_time_constant: 900, source: made up"""


def slow_motor(desk, speeds: str) -> DeviceChoice:
    """The shipped motors, but one for joint 2 with other speeds."""
    catalogue = (models_dir() / "motors.yaml").read_text() + MOTOR + speeds + "}\n"
    (desk / "own.yaml").write_text(catalogue)
    return DeviceChoice(["", "SLOW", "", ""], fitted=[*FITTED], catalogue="own.yaml")


def test_chosen_motors_limit_planner_and_loop_as_the_same_numbers_of_the_drive_do(designed, desk):
    scenario, rpm = designed("[0.25, 1], [0.5, 0]").scenario, np.pi / 30
    scenario.plant.friction.coulomb = [0, 600.0, 0, 0]  # the planner does not take it into account
    speeds = f", n1_rpm: {0.25 / rpm!r}, n0_rpm: {1.02 / rpm!r}"
    chosen = make_design(replace(scenario, device=slow_motor(desk, speeds)))
    assert chosen.envelope.source == "the motors of the catalogue (AC-203, SLOW, TM-2150, TM-2150)"
    first = simulate(chosen)
    assert first.saturated[:, 1].any() and first.v[:, 1].max() > 0.6
    free = replace(scenario, device=slow_motor(desk, ""))
    drive = Drive(n1=[*chosen.envelope.n1], n0=[*chosen.envelope.n0])
    given = make_design(replace(free, drive=drive))
    assert given.envelope.source.startswith("drive.n1 and drive.n0, instead of the motors of the")
    for name, values in vars(simulate(given)).items():
        np.testing.assert_array_equal(values, getattr(first, name), err_msg=name)
    assert motor_loads(chosen, first, 0.5) == motor_loads(given, first, 0.5)
    free = make_design(free)
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
