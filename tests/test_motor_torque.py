"""What motors give within the periods, against a walk through the loop in small steps."""

import copy

import numpy as np
import pytest

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.design import make_design
from sdt_drake.device import Drive, Elasticity
from sdt_drake.loops import loop_period, make_loop
from sdt_drake.motion import Motion
from sdt_drake.simulate import make_simulator, simulate
from sdt_drake.start import start_in_equilibrium

PERIODS, STEPS = 60, 50  # 0.3 s of motion, in steps of 0.1 ms


def short_motion():
    """All joints speed up; joint 2 for a while faster than its motor can."""
    t = 0.005 * np.arange(PERIODS + 1)
    v = np.outer(t, [0.45, 3.0, 0.25, 0.4])
    v[20:, 1] += 2.0 * np.minimum((t[20:] - t[20]) / 0.01, 1.0)
    return Motion.from_speeds(0.005, np.array([0.0, 0.3, 0.1, 0.1]), v)


def design_of(base, label, plant, drive, elasticity=None):
    scenario = with_controller(copy.deepcopy(base.scenario), label)
    scenario.plant.kind, scenario.drive = plant, drive
    scenario.plant.elasticity = elasticity
    return make_design(scenario, robot=base.robot, motion=short_motion())


def walked(design):
    """Peak, RMS and share of time saturated of each period, (3, N, n), by small steps."""
    loop, period = make_loop(design), loop_period(design)
    simulator = make_simulator(loop, max_step=period)
    context = simulator.get_mutable_context()
    start_in_equilibrium(design, loop, context)
    simulator.Initialize()

    def value(name):
        sink = loop.GetSubsystemByName(f"log.{name}")
        return sink.get_input_port().Eval(sink.GetMyContextFromRoot(context)).copy()

    found = []
    for i in range(PERIODS):
        torque, saturated = [], []
        for step in range(STEPS):
            simulator.AdvancePendingEvents()  # what happens at this instant
            ends = []
            for end in (0, 1):
                if end:
                    simulator.AdvanceTo((i + (step + 1) / STEPS) * period)
                torque.append(value("tau"))
                ends.append(value("tau_cmd") != value("tau_limited"))
            saturated.append(np.mean(ends, axis=0))
        a, b = np.array(torque[::2]), np.array(torque[1::2])
        rms = np.sqrt(np.mean((a * a + a * b + b * b) / 3, axis=0))
        found.append((np.abs(torque).max(axis=0), rms, np.mean(saturated, axis=0)))
    return np.moveaxis(np.array(found), 1, 0)


ENVELOPE = {"n1": [20.0, 0.1, 5.0, 5.0], "n0": [300.0, 4.0, 30.0, 30.0]}
CASES = {
    "pi": ("pi", "coupled", None),
    "pi_id": ("pi_id", "coupled", None),
    "p_pi+id": ("p_pi+id", "coupled", Drive()),
    "pi_scheduled+id": ("pi_scheduled+id", "coupled", None),
    "inverse_dynamics": ("inverse_dynamics", "coupled", None),
    "axis": ("pi_ctc", "axis", None),
    "envelope": ("pi_id", "coupled", Drive(**ENVELOPE)),
    "late": ("p_pi+id", "coupled", Drive(reference_delay=0.0072)),
    "lag": ("pi_id", "coupled", Drive(torque_bandwidth=200.0, torque_error=[0.1, -0.1, 0, 0.05])),
    "sampled": ("pi_id", "coupled", Drive(period=0.001, **ENVELOPE)),
    "sampled, late, lag": (
        "p_pi+id",
        "coupled",
        Drive(period=0.001, torque_bandwidth=400.0, reference_delay=0.007),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_torque_within_the_periods(design, case):
    own = design_of(design, *CASES[case])
    run, expected = simulate(own), walked(own)
    limit = own.robot.motor_torque_limit

    peak, rms, saturated = (run.tau_peak[1:], run.tau_rms[1:], run.saturated[1:])
    off = 2e-2 if case == "late" else 3e-3
    np.testing.assert_allclose(peak / limit, expected[0] / limit, rtol=0, atol=off)
    np.testing.assert_allclose(rms / limit, expected[1] / limit, rtol=0, atol=off)
    np.testing.assert_allclose(saturated.mean(axis=0), expected[2].mean(axis=0), atol=4e-3)
    assert np.any(saturated[:, 1] > 0) == (case not in ("pi", "axis"))


def test_motors_behind_springs_are_taken_as_their_encoders_see_them(design):
    springs = Elasticity([60.0, 80.0, 100.0, 100.0], damping_ratio=0.05)
    own = design_of(design, "pi_id", "coupled", None, springs)
    limit, smooth = own.robot.motor_torque_limit, slice(0, 19)  # before the jolt
    peak = simulate(own).tau_peak[1:]
    np.testing.assert_allclose(peak[smooth] / limit, walked(own)[0][smooth] / limit, atol=5e-3)


def test_ends_of_the_periods_are_not_all(design):
    """With K_PS on the error, the start has K_PS r times a period's acceleration more."""
    own = design_of(design, "pi_id", "coupled", None)
    run = simulate(own)
    more = run.tau_peak[30:, 0] - np.abs(run.tau[30:, 0])
    jump = own.gains.kp[0] * own.robot.gear_ratio[0] * 0.45 * 0.005
    np.testing.assert_allclose(more, jump, rtol=0.35)
