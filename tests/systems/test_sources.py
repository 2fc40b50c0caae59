"""References, tables and holds, late or not; the meter, and torques online."""

import dataclasses
import gc

import numpy as np
import pytest
from helpers.alone import LIMIT, LOADS, MOTION, PERIOD, Alone, N, exact, made, outputs_of
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput, Sine

from sdt_drake.robot.robot import load_robot
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import make_simulator, simulate
from sdt_drake.systems import add_meter, hold_of, mean_torque
from sdt_drake.systems import load_torque as module
from sdt_drake.systems.reference import start_table

ROWS = np.hstack([MOTION.q, MOTION.v, MOTION.vd])
SIGNALS = {**LOADS._asdict(), "inertia_share": MOTION.v}


def near(actual, expected):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-9)


def test_reference_is_exact_at_samples_and_linear_between():
    block = Alone("reference_source")
    for i, share in [*((i, 0) for i in range(3000)), (0, 0.5), (7, 0.25), (2999, 0.9)]:
        block.context.SetTime((i + share) * PERIOD)
        expected = (1 - share) * ROWS[i] + share * ROWS[i + 1]
        np.testing.assert_allclose(block.output("reference"), expected, rtol=0, atol=1e-8 * share)


# Offsets of the samples are the delay without its whole periods.
# 0.035 s are 7 periods, but for the last bit.
@pytest.mark.parametrize(
    ("delay", "offset"), [(0.0, 0.0), (0.035, 0.0), (0.0015, 0.0015), (0.0499, 0.0049)]
)
def test_delayed_samples_hold_from_their_arrival(delay, offset):
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("source", made("reference_source", delay=delay))
    hold = builder.AddNamedSystem("hold", hold_of(MOTION, 3 * N, delay=delay))
    table = builder.AddNamedSystem("table", made("signal_table", signals=SIGNALS, delay=delay))
    assert not hold.HasAnyDirectFeedthrough()
    builder.Connect(source.get_output_port(), hold.get_input_port())
    builder.ExportOutput(source.get_output_port(), "source")
    for name, port in (outputs_of(table) | {"reference": hold.get_output_port()}).items():
        builder.ExportOutput(port, name)
    rows = {"reference": ROWS, **SIGNALS}
    both = Alone(builder.Build())
    assert both.timing == pytest.approx((offset, PERIOD), rel=1e-12, abs=0)
    start_table(table, table.GetMyMutableContextFromRoot(both.context))
    for name, samples in rows.items():  # a hold alone starts with nothing
        exact(both.output(name), samples[0] * (name != "reference"))
    late = round((delay - offset) / PERIOD)  # samples before row 0 arrives
    for k in [*range(-late, 4), 1234, 2998]:
        instant = offset + (k + late) * PERIOD
        both.context.SetTime(instant)
        near(both.output("source"), ROWS[max(k, 0)])
        both.sample(instant)
        both.context.SetTime(instant + 0.99 * PERIOD)
        for name, samples in rows.items():
            near(both.output(name), samples[max(k, 0)])


# --- meter -----------------------------------------------------------------------------------


def test_meter_reads_mean_of_sine_without_integrator_steps():
    """0 over whole periods, 2 A / pi over half of one."""
    parts = {
        "tau_cmd": ConstantVectorSource(3 * LIMIT),
        "tau_limited": ConstantVectorSource(LIMIT),
        "tau": Sine(np.array([80.0, -10, 0]), 2 * np.pi * np.array([10.0, 5, 1]), np.zeros(3)),
    }
    builder = DiagramBuilder()
    for name, part in parts.items():
        builder.AddNamedSystem(name, part)
    ports = {name: part.get_output_port(0) for name, part in parts.items()}
    signals = add_meter(builder, motor_torque_limit=LIMIT, **ports)
    log = LogVectorOutput(signals, builder, publish_period=0.1)
    simulator = make_simulator(builder.Build(), period=0.001, accuracy=1e-12)
    simulator.Initialize()
    simulator.AdvanceTo(0.2)
    commanded, limited, _, metered = np.hsplit(log.FindLog(simulator.get_context()).data().T, 4)
    exact(commanded, [3 * LIMIT] * 3)
    exact(limited, [LIMIT] * 3)
    mean = mean_torque(np.array([metered[:-1], metered[1:]]), LIMIT, np.full((2, 1), 0.1))
    half = 2 * 10 / np.pi
    np.testing.assert_allclose(mean, [[0, -half, 0], [0, half, 0]], atol=1e-6 * LIMIT.max())
    assert simulator.get_integrator().get_num_steps_taken() <= 201  # of 1 ms


# --- torques of the reference online ---------------------------------------------------------


@pytest.fixture
def calls(monkeypatch):
    """The references that inverse dynamics was computed for."""
    seen, real = [], module.groups_of_sample

    def counted(robot, context, q_and_v, vd):
        seen.append(np.concatenate([q_and_v, vd]))
        return real(robot, context, q_and_v, vd)

    monkeypatch.setattr(module, "groups_of_sample", counted)
    return seen


def test_online_torques_are_evaluated_once_per_sample(designed, calls):
    # With a disturbance the loop depends on time. Both the load torque and the feedforward use it.
    fields = {"inverse_dynamics": "online", "controller.kind": "pi_id"}
    fields |= {"disturbance.amplitude": 0.05}
    design = designed("coupled_pi_ctc", fields, start=2.1, end=2.4)
    motion = design.reference.tracked
    calls.clear()
    simulate(design)
    references = np.hstack([motion.q, motion.v, motion.vd])
    counts = [np.sum((calls == reference).all(axis=1)) for reference in references]
    assert len(calls) == sum(counts)
    # The start takes the first sample, too; the last acts after the end.
    assert counts[1:] == [2] * (len(counts) - 2) + [0] and 2 <= counts[0] <= 4


def test_simulator_outlives_robot_and_design(robot, designed):
    online = designed("coupled_pi_ctc", {"inverse_dynamics": "online"}, end=0.2)

    def speeds(nominal):
        loop = make_loop(dataclasses.replace(online, nominal=nominal()))
        simulator = make_simulator(
            loop.diagram, period=online.reference.tracked.period, accuracy=1e-4
        )
        del loop
        gc.collect()
        simulator.AdvanceTo(0.1)
        return simulator.get_context().get_continuous_state_vector().CopyToVector()

    np.testing.assert_array_equal(speeds(load_robot), speeds(lambda: robot))
