"""The meter alone: mean, RMS and time in saturation of torques known by hand."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput, Saturation, Sine

from sdt_drake.run.simulate import make_simulator
from sdt_drake.systems import add_meter, read_meter

LIMIT = np.array([100.0, 20.0, 5.0])


def metered(asked, tau, accuracy=1e-12):
    """Two readings of 0.1 s, and the steps that an integrator took."""
    builder = DiagramBuilder()
    command = builder.AddSystem(ConstantVectorSource(np.array(asked)))
    limited = builder.AddSystem(Saturation(-LIMIT, LIMIT))
    builder.Connect(command.get_output_port(), limited.get_input_port())
    given = builder.AddSystem(tau)
    ports = {"tau_cmd": command, "tau_limited": limited, "tau": given}
    ports = {name: block.get_output_port(0) for name, block in ports.items()}
    _, state = add_meter(builder, motor_torque_limit=LIMIT, **ports)
    log = LogVectorOutput(state, builder, publish_period=0.1)
    simulator = make_simulator(builder.Build(), period=0.001, accuracy=accuracy)
    simulator.Initialize()
    simulator.AdvanceTo(0.2)
    found = read_meter(log.FindLog(simulator.get_context()).data().T, LIMIT, 0.1)
    return found, simulator.get_integrator().get_num_steps_taken()


def test_mean_and_rms_of_a_sine_about_a_torque():
    """Over whole periods of a sine, mean 0 and RMS A / sqrt(2); over half ones 2 A / pi."""
    tau = Sine(np.array([80.0, -10.0, 0.0]), 2 * np.pi * np.array([10.0, 5.0, 1.0]), np.zeros(3))
    (mean, rms, _), steps = metered([0.0, 0.0, 0.0], tau)
    half = 2 * 10 / np.pi
    np.testing.assert_allclose(mean, [[0, -half, 0], [0, half, 0]], atol=1e-6)
    np.testing.assert_allclose(rms, 2 * [[80 / 2**0.5, 10 / 2**0.5, 0]], atol=1e-6)
    assert steps <= 201  # of 1 ms, however exact the rest has to be


@pytest.mark.parametrize("sign", [1, -1])
def test_a_command_at_its_limit_is_not_saturated(sign):
    """One just beyond it is, all the time."""
    asked = sign * LIMIT * [1.0, 1.0 + 1e-15, 3.0]
    (_, _, share), _ = metered(asked, ConstantVectorSource(np.zeros(3)))
    np.testing.assert_allclose(share, [[0, 1, 1], [0, 1, 1]], rtol=1e-12)
    assert not share[:, 0].any()
