"""The pilot in the loop: sensors by the head's recursion, the felt attitude by its equations."""

import numpy as np
import pytest
from helpers.alone import FEELING
from oracles.block_laws import orientation_observer
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from sdt_drake.io.errors import InputError
from sdt_drake.io.yaml_files import write_yaml
from sdt_drake.pilot.head import head_motion, head_motion_of_samples
from sdt_drake.pilot.illusions import feel
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import make_simulator, simulate

EXACT = {"accuracy": 1e-10}
HAIR = 1e-10  # s
STEPS = 12  # in a period


@pytest.fixture
def feeling(tmp_path):
    """A perception model whose numbers differ on all axes, as the oracle has them."""
    write_yaml(file := tmp_path / "feeling.yaml", FEELING)
    return {"pilot.model": str(file)}


def head_now(loop, context):
    """Specific force [m/s²] and rate [rad/s] from q, v and the rates of the plant's state."""
    design = loop.design
    q, v = np.split(loop.diagram.GetOutputPort("state").Eval(context), 2)
    device = loop.diagram.GetSubsystemByName("device")
    plant = device.GetSubsystemByName("multibody_plant")
    own = plant.GetMyContextFromRoot(context)
    vd = plant.EvalTimeDerivatives(own).CopyToVector()[design.nominal.n :]
    head = head_motion(design.device.simulated, q[None], v[None], vd[None])
    return np.append(head.specific_force[0], head.angular_velocity[0])


def test_sensors_measure_the_force_and_rate_of_the_recursion(designed):
    design = designed("uncertain", start=9.0, end=9.5)
    loop = make_loop(design, pilot=True)
    simulator = make_simulator(loop.diagram, period=0.005, accuracy=1e-4)
    context = simulator.get_mutable_context()
    loop.set_steady_state(context)
    for time in np.linspace(0.0013, 0.5, 40):
        simulator.AdvanceTo(time)
        sensed = [
            loop.diagram.GetOutputPort(name).Eval(context)
            for name in ("specific_force", "angular_rate")
        ]
        np.testing.assert_allclose(np.concatenate(sensed), head_now(loop, context), atol=1e-9)


def walked(design, steps):
    """Force and rate just after and just before each of small steps, (2, N, 6), without a pilot."""
    loop = make_loop(design, pilot=False)
    simulator = make_simulator(loop.diagram, period=0.005, accuracy=1e-10)
    context = simulator.get_mutable_context()
    loop.set_steady_state(context)
    simulator.Initialize()
    first, ends = head_now(loop, context), []
    simulator.AdvancePendingEvents()
    for i in range(len(design.reference.held.v) - 1):
        for part in range(1, steps + 1):
            # Updates are at multiples of the period, to the last bit.
            end = (i + 1) * 0.005 if part == steps else i * 0.005 + part * (0.005 / steps)
            after = head_now(loop, context)
            simulator.AdvanceTo(end - HAIR)
            before = head_now(loop, context)
            simulator.AdvanceTo(end)
            simulator.AdvancePendingEvents()
            ends.append((after, before))
    return first, np.array(ends), 0.005 / steps


@pytest.mark.oracle
def test_felt_attitude_is_that_of_the_equations_afterwards(designed, feeling):
    """Runge and Kutta's method on the observer's equations, along what the head did in a run of its
    own: equal to 1e-6 rad and rad/s."""
    design = designed("coupled_pi_ctc", EXACT, start=9.0, end=9.1)
    first, ends, h = walked(design, STEPS)
    f, omega = -first[:3] / 9.81, first[3:]
    down = f / np.linalg.norm(f)
    x = np.concatenate([f, omega, omega, np.zeros(3), f, [0.0], down, np.zeros(6)])

    def rates(x, u):
        return orientation_observer(x, u[:3], u[3:])[1]

    felt = [orientation_observer(x, *np.split(first, 2))[0]]
    for after, before in ends:
        middle = (after + before) / 2
        k1 = rates(x, after)
        k2 = rates(x + h / 2 * k1, middle)
        k3 = rates(x + h / 2 * k2, middle)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rates(x + h * k3, before))
        felt.append(orientation_observer(x, *np.split(before, 2))[0])
    run = simulate(designed("coupled_pi_ctc", EXACT | feeling, start=9.0, end=9.1))
    gravity, rate = (np.array([y[name] for y in felt[::STEPS]]) for name in ("gravity", "rate"))
    roll = np.arctan2(-gravity[:, 1], -gravity[:, 2])
    pitch = np.arctan2(-gravity[:, 0], np.hypot(gravity[:, 1], gravity[:, 2]))
    attitude = run.probes["pilot.felt_attitude"]
    assert np.ptp(attitude, axis=0).min() > 1e-3
    np.testing.assert_allclose(attitude[1:], np.transpose([roll, pitch])[1:], atol=1e-6)
    np.testing.assert_allclose(run.probes["pilot.felt_rate"][1:], rate[1:], atol=1e-6)


def test_offline_figures_are_those_of_the_loop_but_for_their_differences(designed):
    """They take accelerations from samples of speeds, and are good to 0.01 deg."""
    run = simulate(make_loop(designed("coupled_pi_ctc", end=2.5), pilot=True))
    head = head_motion_of_samples(designed("coupled_pi_ctc", end=0.1).nominal, 0.005, run.q, run.v)
    felt = feel(head, 0.005, "clark2019")
    attitude = np.transpose([felt.roll, felt.pitch])
    np.testing.assert_allclose(run.probes["pilot.felt_attitude"], attitude, atol=2e-4)
    np.testing.assert_allclose(run.probes["pilot.angular_rate"], head.angular_velocity, atol=1e-12)


def test_the_pilot_does_not_act(designed):
    design = designed("coupled_pi_ctc", end=1.0)
    felt = simulate(make_loop(design, pilot=True))
    np.testing.assert_allclose(felt.v, simulate(design).v, atol=3e-5)
    assert simulate(design).probes == {}


def test_noise_has_its_sizes_and_is_that_of_its_seed(designed):
    noise = {"pilot.model": "clark2019", "pilot.force_noise": 0.3, "pilot.rate_noise": 0.02}

    def sensed(**fields):
        loop = make_loop(designed("coupled_pi", noise | fields, end=2.0))
        run = simulate(loop)
        return np.hstack([run.probes[f"pilot.{x}"] for x in ("specific_force", "angular_rate")])

    quiet = simulate(make_loop(designed("coupled_pi", end=2.0), pilot=True)).probes
    truth = np.hstack([quiet["pilot.specific_force"], quiet["pilot.angular_rate"]])
    one, again, other = sensed(), sensed(), sensed(**{"pilot.seed": 1})
    np.testing.assert_array_equal(one, again)
    assert not np.any(np.all(one == other, axis=1)[2:])
    sizes = (one - truth)[2:].std(axis=0)
    np.testing.assert_allclose(sizes, np.repeat([0.3, 0.02], 3), rtol=0.1)
    correlation = np.corrcoef((one - truth)[2:].T) - np.eye(6)
    assert np.abs(correlation).max() < 0.15


def test_felt_attitude_is_an_output_for_other_blocks(designed):
    loop, builder = make_loop(designed("coupled_pi", end=0.1), pilot=True), DiagramBuilder()
    builder.AddSystem(loop.diagram)
    builder.ExportOutput(loop.diagram.GetOutputPort("felt_attitude"), "felt_attitude")
    diagram = builder.Build()
    assert Simulator(diagram) and diagram.GetOutputPort("felt_attitude").size() == 2
    plain = make_loop(designed("coupled_pi", end=0.1)).diagram
    assert not plain.HasOutputPort("felt_attitude") and not plain.HasSubsystemNamed("pilot")


def test_bad_pilots_are_one_line_with_field_and_limits(designed):
    for name, fields, message in (
        ("axis_pi", {"pilot.model": "clark2019"}, "pilot.model: needs plant.kind coupled"),
        ("coupled_pi", {"pilot.force_noise": -1}, "pilot.force_noise: -1, expected a number >= 0"),
        ("coupled_pi", {"pilot.seed": 1.5}, "pilot.seed: 1.5, expected"),
    ):
        with pytest.raises(InputError) as refused:
            designed(name, fields, end=0.1)
        assert message in f"{refused.value}".splitlines()[0]
    with pytest.raises(InputError, match=r"^pilot: needs plant\.kind coupled"):
        make_loop(designed("axis_pi", end=0.1), pilot=True)
