"""The meter alone: mean torques that are known by hand."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput, Sine

from sdt_drake.run.simulate import make_simulator
from sdt_drake.systems import add_meter, mean_torque

LIMIT = np.array([100.0, 20.0, 5.0])


def test_mean_of_a_sine_over_whole_and_half_periods():
    """0 and 2 A / pi; the integrator does not see the meter."""
    builder = DiagramBuilder()
    sine = Sine(np.array([80.0, -10.0, 0.0]), 2 * np.pi * np.array([10.0, 5.0, 1.0]), np.zeros(3))
    ports = {
        "tau_cmd": builder.AddSystem(ConstantVectorSource(3 * LIMIT)),
        "tau_limited": builder.AddSystem(ConstantVectorSource(LIMIT)),
        "tau": builder.AddSystem(sine),
    }
    ports = {name: block.get_output_port(0) for name, block in ports.items()}
    signals = add_meter(builder, motor_torque_limit=LIMIT, **ports)
    log = LogVectorOutput(signals, builder, publish_period=0.1)
    simulator = make_simulator(builder.Build(), period=0.001, accuracy=1e-12)
    simulator.Initialize()
    simulator.AdvanceTo(0.2)
    data = log.FindLog(simulator.get_context()).data().T
    asked, limited, _, metered = np.hsplit(data, 4)
    np.testing.assert_array_equal(asked, [3 * LIMIT] * 3)
    np.testing.assert_array_equal(limited, [LIMIT] * 3)
    mean = mean_torque(np.array([metered[:-1], metered[1:]]), LIMIT, np.full((2, 1), 0.1))
    half = 2 * 10 / np.pi
    np.testing.assert_allclose(mean, [[0, -half, 0], [0, half, 0]], atol=1e-6)
    assert simulator.get_integrator().get_num_steps_taken() <= 201  # of 1 ms
