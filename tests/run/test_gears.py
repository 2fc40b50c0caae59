"""Backlash, gear efficiency and torque ripple: by hand, power by power, order by order."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from sdt_drake.analysis.linear import linearise
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.robot.device import Springs
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.systems import axis_process, elastic_joints


def test_two_masses_with_play_move_apart_until_they_touch_and_keep_their_energy():
    """I_m r theta" = tau in the play; then W = tau r theta = kinetic energy + k wound² / 2."""
    r, rotor, link, k, play, tau = 50.0, 0.02, 0.5, 4e4, 0.1, 3.0
    springs = Springs(np.array([True]), np.array([k]), np.zeros(1), np.array([play]))
    builder = DiagramBuilder()
    axis = builder.AddNamedSystem("axis", axis_process(i_eff=[link], gear_ratio=[r]))
    joint = builder.AddNamedSystem(
        "joint", elastic_joints(springs=springs, rotor_inertia=[rotor], gear_ratio=[r])
    )
    for system, port, value in ((joint, "tau", tau), (axis, "load_torque", 0.0)):
        source = builder.AddSystem(ConstantVectorSource([value]))
        builder.Connect(source.get_output_port(), system.GetInputPort(port))
    builder.Connect(axis.get_output_port(), joint.GetInputPort("state"))
    builder.Connect(joint.GetOutputPort("tau_link"), axis.GetInputPort("tau"))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.get_mutable_integrator().set_target_accuracy(1e-9)
    simulator.get_mutable_integrator().set_maximum_step_size(1e-3)
    context = simulator.get_mutable_context()

    def motion():
        q, v = axis.get_output_port().Eval(axis.GetMyContextFromRoot(context))
        own = joint.GetMyContextFromRoot(context)
        theta, w = joint.GetOutputPort("motor_state").Eval(own)
        return q, v, theta, w

    touch = np.sqrt(2 * (play / 2) * rotor * r / tau)
    simulator.AdvanceTo(0.999 * touch)
    q, v, theta, w = motion()
    assert max(abs(q), abs(v)) < 1e-12 and theta == pytest.approx(play / 2 * 0.999**2, rel=1e-6)
    for time in np.linspace(1.2, 8, 9) * touch:
        simulator.AdvanceTo(time)
        q, v, theta, w = motion()
        wound = theta - q - np.clip(theta - q, -play / 2, play / 2)
        energy = r**2 * (rotor * w**2 + link * v**2) / 2 + k * wound**2 / 2
        assert energy == pytest.approx(tau * r * theta, rel=1e-5)
    assert q > 0


@pytest.mark.parametrize("kind", ["axis", "coupled"])
def test_gears_take_their_share_of_the_power_in_both_directions(designed, kind):
    """Power of the motors less that of the links, at each sample: by eta if they drive."""
    eta = np.array([0.9, 0.8, 0.7, 0.95])
    fields = {"plant.gear_efficiency": eta, "plant.kind": kind, "disturbance.amplitude": 0.0}
    run = simulate(designed("coupled_pi", fields, start=2.0, end=3.0), probes=["gear_loss"])
    fast = np.abs(run.v) > 0.01
    power, lost = (run.tau * run.v)[fast], (run.probes["gear_loss"] * run.v)[fast]
    share = np.broadcast_to(eta, run.v.shape)[fast]
    assert np.any(power > 0) and np.any(power < 0)
    given = np.where(power > 0, share * power, power / share)
    np.testing.assert_allclose(power - lost, given, rtol=1e-9, atol=1e-9)


def test_a_motor_lifts_with_load_over_efficiency_and_lowers_with_load_times_it(designed):
    """Joint 2 of the device turns a constant load at constant speed, from the first sample on."""
    design = designed("coupled_pi", {"plant.gear_efficiency": [0.8] * 4}, end=0.1)
    for v2 in (0.2, -0.2):
        motion = Motion.from_speeds(0.005, np.array([0, 0.5, 0, 0]), np.tile([0, v2, 0, 0], (3, 1)))
        runs = [
            simulate(make_design(scenario, robot=design.nominal, motion=motion))
            for scenario in (design.scenario, load_scenario("coupled_pi"))
        ]
        lossy, plain = (run.tau[0, 1] for run in runs)
        drives = plain * v2 > 0
        assert lossy == pytest.approx(plain / 0.8 if drives else plain * 0.8, rel=1e-6)


def test_ripple_shows_in_the_speed_at_its_orders_by_the_response_of_the_loop(designed):
    """At constant speed: amplitude of v at h r v_0 is |v / tau_ff| of the linear loop times L a."""
    period, v0, turns = 0.005, 2 * np.pi / 8, 4
    orders, shares, joint = [3.0, 8.0], [0.004, 0.01], 1
    samples = round(turns * 8 / period)
    v = np.zeros((samples + 1, 4))
    v[:, joint] = v0
    plain = designed("axis_pi", end=0.1)
    motion = Motion.from_speeds(period, np.zeros(4), v)  # no load: it would modulate the orders
    ripple = {"drive.ripple_harmonics": orders, "drive.ripple_amplitude": shares}
    runs = [
        simulate(make_design(x, robot=plain.nominal, motion=motion).assuming(loaded=False))
        for x in (plain.scenario, plain.scenario.changed(ripple))
    ]
    difference = (runs[1].v - runs[0].v)[-samples // 2 :, joint]
    design = make_design(plain.scenario, robot=plain.nominal, motion=motion)
    omega = np.array(orders) * design.nominal.gear_ratio[joint] * v0
    by_torque = (
        linearise(design, 0, at_rest=True).whole().response(omega)[:, 12 + joint, 12 + joint]
    )
    spectrum = 2 * np.abs(np.fft.rfft(difference)) / len(difference)
    at = np.round(omega * len(difference) * period / (2 * np.pi)).astype(int)
    limit = design.device.simulated.motor_torque_limit[joint]
    expected = np.abs(by_torque) * limit * np.array(shares)
    np.testing.assert_allclose(spectrum[at], expected, rtol=0.02)
    others = np.delete(spectrum, at)
    assert others.max() < 0.05 * expected.min()


ALL = {
    "plant.elasticity.natural_frequency": [65.0, 65.0, 0.0, 0.0],
    "plant.elasticity.backlash": [1e-4, 2e-4, 0.0, 0.0],
    "plant.gear_efficiency": [0.9] * 4,
    "drive.ripple_harmonics": [1.0, 6.0],
    "drive.ripple_amplitude": [0.01, 0.02],
}


def test_a_run_with_all_of_it_starts_in_equilibrium(designed):
    run = simulate(designed("coupled_pi", ALL, end=0.02, rest=4))
    np.testing.assert_allclose(run.q[:5], run.q[[0] * 5], atol=1e-7)
    np.testing.assert_allclose(run.tau[:5], run.tau[[0] * 5], rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"plant.elasticity.backlash": [1e-4] * 4}, r"backlash\[1\]: 0.0001, needs natural_fre"),
        (
            {"plant.elasticity.backlash": [-1.0] * 4},
            r"backlash\[1\]: -1\.0, expected a number >= 0 and <= 1 ",
        ),
        (
            {"plant.gear_efficiency": [0.0] * 4},
            r"efficiency\[1\]: 0\.0, expected a number > 0 and <= 1",
        ),
        ({"plant.gear_efficiency": [0.9]}, r"gear_efficiency: 1 value\(s\), expected 4"),
        ({"drive.ripple_harmonics": [6.0]}, r"ripple_amplitude: 0 value\(s\), expected 1"),
    ],
)
def test_a_bad_gear_is_a_line_with_field_and_limits(designed, fields, said):
    with pytest.raises(InputError, match=said):
        designed("axis_pi", fields, end=0.1)
