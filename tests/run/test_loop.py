"""Loops against independent integrations, and how accurate a run is."""

import dataclasses

import numpy as np
import pytest
from helpers.variants import kind, weaker
from oracles.by_hand import axes_by_hand, inverse_dynamics, robot_by_hand

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.motion import Motion
from sdt_drake.robot.device import Drive
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import simulate

# Share of the torque limits of each joint: they all saturate, but none is lost.
WEAK = np.array([0.5, 0.9, 0.2, 0.15])
CONSISTENT = {"algorithm": "consistent"}
WITH_ERROR = {"drive": Drive(torque_error=[0.2, -0.3, 0.1, 0.0])}
AXES = {
    "weak, printed": ("axis_pi", {}),
    "weak, ctc, consistent": ("axis_pi_ctc", CONSISTENT),
    "pi_id": ("axis_pi_ctc", CONSISTENT | kind("pi_id")),
    "pi_scheduled": ("axis_pi", CONSISTENT | kind("pi_scheduled+ctc", setpoint_weight=1)),
    "torque error": ("axis_pi", CONSISTENT | WITH_ERROR),
}


@pytest.fixture(scope="module")
def axes(designed):
    """Designs by case, and their speeds, all integrated at once."""
    designs = {case: designed(*fields, end=10.5) for case, fields in AXES.items()}
    designs = {k: weaker(x, WEAK if "weak" in k else 1.0) for k, x in designs.items()}
    speeds = axes_by_hand(list(designs.values()), steps=6)
    return {case: (designs[case], speeds[:, k]) for k, case in enumerate(designs)}


@pytest.mark.parametrize("case", AXES)
def test_axis_loop_equals_plain_numpy(axes, case):
    design, speeds = axes[case]
    recording = simulate(design)
    saturated = np.mean(recording.tau_limited != recording.tau_cmd, axis=0)
    assert "weak" not in case or np.all(saturated > 0.01)
    tolerance = 1e-4 if saturated.any() else 3e-5
    np.testing.assert_allclose(recording.v, speeds, rtol=0, atol=tolerance)
    given = 1 + np.array(design.drive.torque_error or np.zeros(4))
    np.testing.assert_allclose(recording.tau, given * recording.tau_limited, rtol=1e-12)
    if case == "pi_id":
        np.testing.assert_allclose(
            design.tuning.feedforward.along, inverse_dynamics(design), rtol=1e-9, atol=1e-9
        )


@pytest.mark.parametrize(("limit", "widen"), [(1.0, False), (0.4, True)])
def test_coupled_loop_equals_equations_of_motion(designed, limit, widen):
    disturbed = {"disturbance.amplitude": 0.05}
    design = weaker(designed("coupled_pi_ctc", disturbed, end=1.5), limit)
    states = robot_by_hand(design, widened=widen)
    recording = simulate(design.assuming(widened=widen))
    assert np.any(recording.tau != recording.tau_cmd) == (limit < 1)
    np.testing.assert_allclose(recording.v, states[:, 1], rtol=0, atol=1e-4)
    np.testing.assert_allclose(recording.q, states[:, 0], rtol=0, atol=1e-4)


# --- what `accuracy` promises ----------------------------------------------------------------

# Where motors saturate most, and other hard parts of motions.
PARTS = [
    ("axis_pi", "pi", 9.2, 10.4),
    ("coupled_pi", "inverse_dynamics", 9.2, 9.7),
    ("uncertain", "pi_scheduled", 9.2, 9.6),
    ("training", "p_pi+id", 6.3, 6.7),
]


@pytest.mark.parametrize(("name", "label", "start", "end"), PARTS)
def test_run_is_as_accurate_as_told(robot, name, label, start, end):
    # One count of an encoder more or less moves speeds by 2e-4 rad/s at any accuracy.
    smooth = load_scenario(name, {"drive.encoder_resolution": None})
    scenario = with_controller(smooth, label)
    whole = make_design(scenario, robot=robot).reference.planned
    rows = slice(round(start / whole.period), round(end / whole.period))
    motion = Motion(whole.period, whole.q[rows], whole.v[rows], whole.vd[rows])
    runs = {}
    for accuracy in (1e-3, 1e-4, 1e-6):
        own = dataclasses.replace(scenario, accuracy=accuracy)
        runs[accuracy] = simulate(make_design(own, robot=robot, motion=motion))
    exact = runs.pop(1e-6)
    off = {accuracy: np.abs(run.v - exact.v).max() for accuracy, run in runs.items()}
    assert scenario.accuracy == 1e-4
    assert off[1e-4] < 1e-4 and off[1e-3] < 5e-4, off
    assert np.abs(runs[1e-4].q - exact.q).max() < 1e-5
