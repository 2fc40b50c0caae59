"""The step loop of Figure 4, and the other loops against independent integrations."""

import control
import numpy as np
import pytest
from by_hand import axes_by_hand, inverse_dynamics, robot_by_hand
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from variants import kind, weaker

from sdt_drake.analysis.reproduction import step_response
from sdt_drake.analysis.step import step_metrics
from sdt_drake.robot.device import Drive
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import simulate
from sdt_drake.systems.gains import tune


@pytest.mark.parametrize(
    ("structure", "zeta", "rise", "settling"),
    [("pi", 1.0, 0.0221, 0.163), ("p_in_feedback", 0.95, 0.0944, 0.1595)],
)
def test_figure_4(structure, zeta, rise, settling):
    """With the damping that the paper took; and the whole response by python-control."""
    gains = tune([4.26], 65.991, [zeta])
    response = step_response(structure, zeta, 4.26, 65.991)
    time, speed = response.time, response.speed
    metrics = step_metrics(time, speed, y0=0, y_final=1)
    assert metrics.rise_time == pytest.approx(rise, rel=0.01)
    assert metrics.settling_time == pytest.approx(settling, rel=0.01)
    if structure == "pi":  # 1 - e^-x (1 - x) has its peak at x = 2
        assert metrics.overshoot_percent == pytest.approx(100 * np.exp(-2), rel=0.01)
    else:
        assert metrics.overshoot_percent < 0.01
    kp, ki = gains.kp[0] / 4.26, gains.ki[0] / 4.26
    zero = [kp, ki] if structure == "pi" else [ki]
    even, expected = control.step_response(control.tf(zero, [1, kp, ki]), np.linspace(0, 0.5, 5001))
    np.testing.assert_allclose(np.interp(even, time, speed), expected, rtol=0, atol=1e-4)


# Share of the torque limits of each joint: they all saturate, but none is lost.
WEAK = np.array([0.5, 0.9, 0.2, 0.15])
CONSISTENT = {"algorithm": "consistent"}
WITH_ERROR = {"drive": Drive(torque_error=[0.2, -0.3, 0.1, 0.0])}
AXES = {
    "weak, printed": ("axis_pi", {}),
    "weak, ctc, printed": ("axis_pi_ctc", {}),
    "weak, ctc, consistent": ("axis_pi_ctc", CONSISTENT),
    "ctc, consistent": ("axis_pi_ctc", CONSISTENT),
    "pi_id": ("axis_pi_ctc", CONSISTENT | kind("pi_id")),
    "pi_scheduled": ("axis_pi", CONSISTENT | kind("pi_scheduled+ctc", structure="pi")),
    "torque error": ("axis_pi", CONSISTENT | WITH_ERROR),
}


@pytest.fixture(scope="module")
def axes(designed):
    """Designs by case, and their speeds, all integrated at once."""
    designs = {
        case: weaker(designed(*AXES[case], end=10.5), WEAK if "weak" in case else 1.0)
        for case in AXES
    }
    speeds = axes_by_hand(list(designs.values()), steps=6)
    return {case: (designs[case], speeds[:, k]) for k, case in enumerate(designs)}


@pytest.mark.parametrize("case", AXES)
def test_axis_loop_against_plain_numpy(axes, case):
    design, speeds = axes[case]
    recording = simulate(design)
    saturated = np.mean(recording.tau_limited != recording.tau_cmd, axis=0)
    assert "weak" not in case or np.all(saturated > 0.01)
    tolerance = 1e-4 if saturated.any() else 3e-5
    np.testing.assert_allclose(recording.v, speeds, rtol=0, atol=tolerance)
    given = 1 + np.array(design.drive.torque_error or np.zeros(4))
    np.testing.assert_allclose(recording.tau, given * recording.tau_limited, rtol=1e-12)
    if case == "pi_id":
        np.testing.assert_allclose(design.tau_ff, inverse_dynamics(design), rtol=1e-9, atol=1e-9)
    if case == "pi_scheduled":
        assert design.inertia_share.min() < 0.97


@pytest.mark.parametrize(("limit", "widen"), [(1.0, False), (0.4, False), (0.4, True)])
def test_coupled_loop_against_the_equations_of_motion(designed, limit, widen):
    disturbed = {"disturbance.amplitude": 0.05}
    design = weaker(designed("coupled_pi_ctc", disturbed, end=1.5), limit)
    states = robot_by_hand(design, widened=widen)
    recording = simulate(design, make_loop(design, widened=widen))
    assert np.any(recording.tau != recording.tau_cmd) == (limit < 1)
    np.testing.assert_allclose(recording.v, states[:, 1], rtol=0, atol=1e-4)
    np.testing.assert_allclose(recording.q, states[:, 0], rtol=0, atol=1e-4)


def test_a_load_from_outside_is_one_that_the_motors_turn_against(designed):
    """The loop in a diagram of one's own, with something that pulls at its motors."""
    design = designed("coupled_pi_ctc", end=0.7)
    extra = np.array([40.0, -200.0, 80.0, 50.0])  # N m, motor side
    builder = DiagramBuilder()
    loop = builder.AddSystem(make_loop(design))
    source = builder.AddSystem(ConstantVectorSource(extra))
    builder.Connect(source.get_output_port(), loop.GetInputPort("extra_load_torque"))
    recording = simulate(design, builder.Build())
    speeds = robot_by_hand(design, extra=extra)[:, 1]
    np.testing.assert_allclose(recording.v, speeds, rtol=0, atol=3e-5)
    assert np.all(np.abs(recording.v - simulate(design).v).max(axis=0) > 1e-3)
