"""Steps at the inputs of the loops of scenarios, by formulas and by laws."""

import numpy as np
import pytest
from oracles.second_order import Formula

import sdt_drake as sdt
from sdt_drake.analysis.step import step_metrics
from sdt_drake.motion import Motion

REST = Motion.from_speeds(0.005, np.zeros(4), np.zeros((401, 4)))
"""Rest of 2 s, where no joint carries a load."""


def formula(design, joint):
    k = joint - 1
    return Formula(design.i_eff[k], design.tuning.gains.kp[k], design.tuning.gains.ki[k])


# --- the axis, by formulas --------------------------------------------------------------------


@pytest.mark.parametrize(("weight", "joint"), [(1, 1), (0, 2), (0.4, 3)])
def test_reference_step_of_an_axis_follows_formula(designed, weight, joint):
    design = designed("axis_pi", {"controller.setpoint_weight": weight}, motion=REST)
    size, k = 0.004, joint - 1
    found = sdt.step(design, joint=joint, size=size, at=0.1, duration=0.4)
    v = size * formula(design, joint).reference_step(weight, found.time)
    np.testing.assert_allclose(found.v[:, k], v, rtol=0, atol=2e-6 * size)
    assert not np.delete(found.v, k, axis=1).any() and not found.saturated.any()
    m = found.metrics["v"][k]
    assert (m.rise_time, m.settling_time) == pytest.approx(
        formula(design, joint).times(weight), abs=1e-4
    )
    assert abs(m.steady_state_error) < 1e-4 * size
    if weight == 0:  # a ramp of the position is followed with 2 zeta / omega_n
        lag = design.tuning.gains.kp[k] / design.tuning.gains.ki[k]
        assert found.position_error[-1, k] == pytest.approx(-size * lag, rel=1e-4)
    assert found.tau_cmd[0, k] == pytest.approx(  # at once, of the proportional gain
        design.tuning.gains.kp[k] * design.device.simulated.gear_ratio[k] * size * weight, abs=1e-12
    )


@pytest.mark.parametrize("joint", [1, 3])
def test_load_step_of_an_axis_is_carried_by_the_integral(designed, joint):
    """Neither speed error nor torque is left; the angle is the load over K_IS."""
    design = designed("axis_pi", motion=REST)
    k, load, r = joint - 1, 20.0, design.device.simulated.gear_ratio[joint - 1]
    found = sdt.step(design, input="extra_load_torque", joint=joint, size=load, duration=0.6)
    axis = formula(design, joint)
    speed = load * axis.load_step(found.time) / r
    np.testing.assert_allclose(found.v[:, k], speed, rtol=0, atol=2e-6 * np.abs(speed).max())
    torque = load * axis.reference_step(1, found.time)
    np.testing.assert_allclose(found.tau[:, k], torque, rtol=0, atol=2e-6 * load)
    m = found.metrics
    assert abs(m["v"][k].steady_state_error) < 1e-6
    assert m["position_error"][k].steady_state_error == pytest.approx(
        -load / (design.tuning.gains.ki[k] * r), rel=1e-5
    )
    assert m["tau"][k].overshoot_percent == pytest.approx(axis.overshoot_percent(1), abs=2e-3)


def test_axis_steps_superpose_at_rest_and_in_motion(designed):
    resting = designed("axis_pi_ctc", motion=REST)
    moving = designed("axis_pi_ctc", start=2.2, end=2.8)
    one = sdt.step(resting, input="tau_cmd", joint=2, size=100.0, duration=0.3)
    two = sdt.step(moving, input="tau_cmd", joint=2, size=-200.0, at=0.2, duration=0.3)
    for name in ("q", "v", "tau_cmd"):
        response = getattr(one, name)
        size = np.abs(response).max()
        np.testing.assert_allclose(-getattr(two, name) / 2, response, rtol=0, atol=1e-5 * size)


# --- the coupled plant ------------------------------------------------------------------------


@pytest.mark.parametrize("anti_windup", [False, True])
def test_torque_command_acts_as_negative_load(designed, anti_windup):
    """On all joints of the moving device, whose accelerations couple them."""
    fields = {"controller.anti_windup": anti_windup, "plant.friction.viscous": [50.0] * 4}
    design = designed("coupled_pi_ctc", fields, start=2.4, end=2.8)
    step = {"joint": 2, "at": 0.2, "duration": 0.15}
    command = sdt.step(design, input="tau_cmd", size=300.0, **step)
    load = sdt.step(design, input="extra_load_torque", size=-300.0, **step)
    for name in ("q", "v"):
        pushed, loaded = getattr(command, name), getattr(load, name)
        assert np.all(np.abs(pushed).max(axis=0) > 1e-7)
        np.testing.assert_allclose(pushed, loaded, rtol=0, atol=1e-5 * np.abs(pushed).max())
    added = (command.tau_cmd - load.tau_cmd)[:, 1]
    np.testing.assert_allclose(added, 300.0, atol=0.01)


def test_stiffness_equals_integral_gain_and_position_loops_leave_no_error(designed):
    load = {"input": "extra_load_torque", "joint": 4, "size": 50.0, "duration": 0.8}
    pi = designed("coupled_pi", motion=REST)
    soft = sdt.step(pi, **load).metrics["position_error"][3]
    assert soft.steady_state_error == pytest.approx(-50.0 / pi.tuning.gains.ki[3], rel=2e-3)
    hard = sdt.step(designed("coupled_pi", {"controller.kind": "p_pi"}, motion=REST), **load)
    assert abs(hard.metrics["position_error"][3].steady_state_error) < 1e-2 * abs(
        soft.steady_state_error
    )


@pytest.mark.parametrize("label", ["pi_id", "p_pi", "pi_scheduled", "inverse_dynamics"])
def test_every_controller_follows_reference_step_at_rest(designed, label):
    design = designed("coupled_pi", {"controller.kind": label}, motion=REST)
    found = sdt.step(design, joint=4, size=0.002, at=0.05, duration=0.35)
    assert found.metrics["v"][3].steady_state_error == pytest.approx(0, abs=2e-5)


def test_feedforward_ignores_reference_step(designed):
    """Whether it is a table, or computed online, where the speed of joint 1 loads joint 2."""
    found = []
    for how in ("table", "online"):
        fields = {"controller.kind": "pi_id", "inverse_dynamics": how}
        design = designed("coupled_pi", fields, start=2.0, end=2.2)
        found.append(sdt.step(design, joint=1, size=0.05, at=0.1, duration=0.05))
    np.testing.assert_allclose(found[1].v, found[0].v, rtol=0, atol=1e-9)
    assert abs(found[0].tau_cmd[0, 1]) < 1e-9


def test_loop_with_real_drive_starts_in_equilibrium(designed):
    """Sampling, delay, friction and springs: nothing happens until the delayed reference steps."""
    fields = {"drive.reference_delay": 0.004}
    design = designed("real_device", fields, motion=REST)
    found = sdt.step(design, joint=1, size=0.001, at=0.05, duration=0.1)
    late = np.searchsorted(found.time, 0.004 - 1e-9)
    assert not found.tau_cmd[:late].any() and found.tau_cmd[late:].any()


# --- the object, and bad use ------------------------------------------------------------------


def test_step_result_names_limits_that_cut_it(designed):
    design = designed("axis_pi", motion=REST)
    found = sdt.step(sdt.loop(design), input="tau_cmd", size=400.0, duration=0.1)
    assert found.saturated[:, 0].any() and not found.saturated[:, 1:].any()
    assert "limits cut the torque of joint 1 'planetary'" in repr(found)
    assert str(found).count("1 planetary") == 4  # v, position error, tau_cmd; tau, which is cut
    assert len(found.plot().axes) == 12
    default = sdt.step(design, duration=0.1)  # K_PS asks for a tenth of the motor's torque
    assert default.size == pytest.approx(0.1 * 203.2 / (267.1 * 67.2))
    assert default.time[-1] == pytest.approx(0.1)
    small = sdt.step(design, input="tau_cmd")
    assert small.size == pytest.approx(20.32)
    assert small.time[-1] == pytest.approx(50 / design.tuning.omega_n.min(), abs=0.005)


WRONG = {
    r"input: 'tau', expected one of reference, extra_load_torque, tau_cmd": {"input": "tau"},
    r"joint: 5, expected 1 to 4": {"joint": 5},
    r"size: 0, expected a number that is not 0, up to 1e\+06": {"size": 0},
    r"size: 2e\+06, expected": {"size": 2e6},
    r"size: nan, expected a finite number": {"size": float("nan")},
    r"at: 0.0012 s, expected a multiple of 0.005 s before the end": {"at": 0.0012},
    r"at: 2 s, expected a multiple": {"at": 2.0},
    r"at: -1, expected a finite number >= 0": {"at": -1},
    r"duration: 3 s, but the motion ends 1.5 s after the step": {"at": 0.5, "duration": 3},
    r"duration: 0, expected a finite number > 0": {"duration": 0},
}


@pytest.mark.parametrize("message", WRONG)
def test_wrong_step_argument_is_one_line(designed, message):
    with pytest.raises(sdt.InputError, match=f"^{message}") as error:
        sdt.step(designed("axis_pi", motion=REST), **WRONG[message])
    assert "\n" not in str(error.value)


def test_step_of_an_open_loop_is_refused(designed):
    design = designed("coupled_pi", motion=REST)
    for parts in ({"controller": "external"}, {"reference": "external"}):
        with pytest.raises(sdt.InputError, match=r"^design: a loop with .* from outside"):
            sdt.step(sdt.loop(design, **parts))


def test_returning_response_settles_into_share_of_its_peak():
    t = np.linspace(0, 10, 10_001)
    m = step_metrics(t, 3 - 2 * t * np.exp(1 - t), y0=3, y_final=3)  # peak -2 at 1
    assert np.isnan([m.rise_time, m.overshoot_percent]).all()
    assert (m.peak, m.peak_time) == pytest.approx((1.0, 1.0))
    assert m.settling_time * np.exp(1 - m.settling_time) == pytest.approx(0.02, rel=1e-3)
    still = step_metrics([0, 1], [3, 3], y0=3, y_final=3)
    assert (still.settling_time, still.peak, still.steady_state_error) == (0, 3, 0)
