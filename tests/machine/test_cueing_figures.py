"""Figures of a motion beside a flight that need no search: reach and objective sheet."""

import numpy as np
import pytest

from sdt_drake.machine.cueing.candidate import Candidate
from sdt_drake.machine.cueing.flight import make_flight
from sdt_drake.machine.cueing.objective import objective
from sdt_drake.machine.cueing.reach import reach
from sdt_drake.motion import Motion
from sdt_drake.pilot import load_perception
from sdt_drake.pilot.head import GRAVITY, head_motion


def test_reach_is_that_of_an_arm_at_top_speed(robot):
    """The head hangs inwards by 0.33 m along the force: tan phi = w² (2.6 - 0.33 sin phi) / g."""
    phi, w = 1.0, 0.98 * robot.velocity_limit[0]
    for _ in range(50):
        phi = np.arctan(w**2 * (2.6 - 0.33 * np.sin(phi)) / GRAVITY)
    force = np.outer(np.repeat([1.0, 3.0, 1.0], [100, 200, 100]), [0, 0, GRAVITY])
    found = reach(robot, make_flight(0.01 * np.arange(400), force, 0 * force))
    assert 1 <= found.g * np.cos(phi) < 1.06  # forces within 16 deg count
    assert found.flown == pytest.approx(3) and found.beyond == pytest.approx(2.0, abs=0.02)
    assert str(found).endswith(
        "the flight has up to 3.0 G, and more than the device for 2 of 3.99 s"
    )


@pytest.mark.parametrize("delay", [0.0, 0.3])
def test_sheet_of_a_delayed_device_is_a_delay(robot, delay):
    """The flight is the head's motion; the device makes it later."""
    time = 0.005 * np.arange(13001)
    parts = [0.1 * np.sin(w * time[:, None] + np.arange(4) * w) for w in (0.5, 1.0, 1.7, 2.5)]
    ends = np.clip(np.minimum(time, time[-1] - time) / 2, 0, 1)[:, None]
    motion = Motion.from_speeds(0.005, np.zeros(4), np.sum(parts, axis=0) * ends)
    head = head_motion(robot, motion.q, motion.v, motion.vd)
    later = round(delay / 0.005)
    inside = slice(400 + later, 12000)
    flight = make_flight(time[inside], head.specific_force[inside], head.angular_velocity[inside])
    sheet = objective(Candidate("", robot, motion, flight, 2.0, load_perception("slow_yaw")))
    one, k = sheet["signals"]["roll"], 5
    assert sheet["frequencies_rad_s"][k] == 1
    assert one["gain"][k] == pytest.approx(1, abs=0.05)
    assert one["phase_deg"][k] == pytest.approx(-np.degrees(delay), abs=3)
    assert one["delay_s"] == pytest.approx(delay)
    if not delay:
        force = sheet["signals"]["fore-aft"]
        assert force["correlation"] == pytest.approx(1) and force["nrmse"] < 1e-3
        assert sheet["false_force_share"] == 0 and sheet["false_rotation_share"] < 0.1


def test_tilt_rate_is_that_of_the_roll_joint(robot):
    v = np.zeros((2001, 4))
    v[1:-1, 1], v[1:-1, 0] = 0.1, 1.0  # the arm turns the head about the vertical
    motion = Motion.from_speeds(0.005, np.zeros(4), v)
    level = np.tile([0, 0, GRAVITY], (100, 1))
    time = 0.08 * np.arange(100.0)
    flight = make_flight(time, level, 1e-3 * np.sin(2 * time)[:, None] + 0 * level)
    sheet = objective(Candidate("", robot, motion, flight, 1.0, load_perception("slow_yaw")))
    assert sheet["tilt_rate_rms_deg_s"] == pytest.approx(np.degrees(0.1), rel=1e-6)
    assert sheet["tilt_rate_noticed_share"] == 1 and sheet["false_rotation_share"] == 1
    unfelt = sheet["signals"]["roll"]  # 0.06 deg/s in flight
    assert np.isnan([*unfelt["gain"], unfelt["nrmse"], unfelt["delay_s"]]).all()
