"""Controllers and drives in the loops, against calculations by hand."""

from __future__ import annotations

import numpy as np
import pytest
from by_hand import GEAR, LIMIT
from variants import kind, overruled

from sdt_drake.motion import Motion
from sdt_drake.robot.device import Drive
from sdt_drake.robot.dynamics import Loads
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import make_simulator, simulate

PERIOD = 0.005  # s
CONSISTENT = {"algorithm": "consistent"}
HANGING = np.array([0.4, 0.15, 0.1, 0.7])  # rad; roll and pitch out of balance


def same(actual, expected, tolerance):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance)


def test_inverse_dynamics_gives_every_joint_its_frequency_and_damping(designed):
    """Off the reference at rest, each error goes its own way: held, e'' = -2 zeta w e' - w² e."""
    zeta, omega = np.array([0.3, 0.5, 0.7, 1.0]), 65.991 / 2
    still = Motion.from_speeds(PERIOD, HANGING, np.zeros((101, 4)))
    fields = kind("inverse_dynamics", zeta=zeta.tolist())
    diagram = make_loop(designed("coupled_pi", fields, motion=still))
    simulator = make_simulator(diagram, period=PERIOD, accuracy=1e-9)
    context = simulator.get_mutable_context()
    plant = diagram.GetSubsystemByName("multibody_plant").plant
    e, v = np.array([1e-4, -2e-4, 1.5e-4, 3e-4]), np.zeros(4)
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), HANGING + e)
    for time in still.time[1:]:
        vd = -2 * zeta * omega * v - omega**2 * e
        e, v = e + PERIOD * v + PERIOD**2 / 2 * vd, v + PERIOD * vd
        simulator.AdvanceTo(time)
        same(plant.GetPositions(plant.GetMyContextFromRoot(context)) - HANGING, e, 5e-7)


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


def test_sampled_drive_by_hand(designed):
    """Constant torque over each period: plain recursions, exact."""
    fields = CONSISTENT | {"controller.structure": "pi", "drive": Drive(period=0.001)}
    design = designed("axis_pi", fields, end=1.0)
    gains, load = design.gains, design.loads.load_torque
    v, integral = np.zeros(4), np.zeros(4)
    speeds = [v]
    for i in range(len(design.motion.v) - 1):
        for _ in range(5):
            error = GEAR * (design.motion.v[i] - v)
            tau = gains.kp * error + gains.ki * integral
            integral = integral + 0.001 * error
            v = v + 0.001 * (tau - load[i]) / (design.i_eff * GEAR)
        speeds.append(v)
    same(simulate(design).v, speeds, 1e-8)


def test_delay_of_whole_periods_shifts_the_response_by_as_many_samples(designed):
    fields = kind("p_pi") | CONSISTENT
    prompt = simulate(designed("axis_pi", fields, end=0.8, rest=3))
    for count in (1, 50):
        delayed = fields | {"drive": Drive(reference_delay=count * PERIOD)}
        late = simulate(designed("axis_pi", delayed, end=0.8, rest=3))
        same(late.v[count:], prompt.v[:-count], 2e-6)
        same(late.v[:count], 0, 1e-12)
        for other in (count - 1, count + 1):  # a sample more or less would show
            assert np.abs(late.v[other:] - prompt.v[: len(late.v) - other]).max() > 1e-3
