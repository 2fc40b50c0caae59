"""The pilot in a loop: sensors at the head, their noise, the observer, and the felt attitude."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import numpy as np
import pydrake.symbolic as sym
from pydrake.common import RandomDistribution, RandomGenerator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import Adder, Demultiplexer, MatrixGain, Multiplexer, RandomSource
from pydrake.systems.sensors import Accelerometer, Gyroscope

from sdt_drake.io.arguments import finite_number, positive
from sdt_drake.pilot.head import HEAD_FRAME, check_head
from sdt_drake.pilot.observer import (
    PerceptionModel,
    load_perception,
    orientation_observer,
    set_unfelt,
)
from sdt_drake.robot.robot import Robot
from sdt_drake.run.design import Design
from sdt_drake.systems.symbolic import Symbols, symbolic_law
from sdt_drake.systems.wiring import build

BY_DEFAULT = "clark2019"
"""Perception model of a loop whose scenario names none."""

_BODIES = ("body_poses", "body_spatial_velocities", "body_spatial_accelerations")


def pilot_at_head(
    *,
    robot: Robot,
    model: PerceptionModel,
    period: float,
    force_noise: float = 0.0,
    rate_noise: float = 0.0,
) -> Diagram:
    """Make a pilot whose head moves with a robot: sensors, their noise, and the observer.

    Drake's Accelerometer and Gyroscope at the frame `head` measure specific force [m/s²] and
    angular rate [rad/s], in its axes. Gaussian noise is added to both, drawn every period. Behind
    it is the `orientation_observer`; the felt attitude is roll to the right and pitch up [rad].
    State: that of the nested system "observer", and the noise. The pilot does not act on the loop.

    Args:
        robot: robot with a frame `head`; the inputs are the outputs of its MultibodyPlant.
        model: perception model of the observer.
        period: sample period of the noise [s], > 0.
        force_noise: standard deviation of the force's noise [m/s²], >= 0.
        rate_noise: standard deviation of the rate's noise [rad/s], >= 0.

    .. pydrake_system::

        name: pilot_at_head
        input_ports: [body_poses, body_spatial_velocities, body_spatial_accelerations]
        output_ports: [specific_force, angular_rate, felt_gravity, felt_rate, felt_attitude]
    """
    check_head(robot)
    positive(period, "period")
    sizes = [
        finite_number(force_noise, "force_noise", minimum=0),
        finite_number(rate_noise, "rate_noise", minimum=0),
    ]
    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect
    head = robot.plant.GetFrameByName(HEAD_FRAME)
    place, gravity = head.GetFixedPoseInBodyFrame(), robot.plant.gravity_field().gravity_vector()
    accelerometer = add("accelerometer", Accelerometer(head.body(), place, gravity))
    gyroscope = add("gyroscope", Gyroscope(head.body(), place))
    for name in _BODIES:
        builder.ExportInput(accelerometer.GetInputPort(name), name)
        if gyroscope.HasInputPort(name):
            builder.ConnectInput(name, gyroscope.GetInputPort(name))
    sensed = [accelerometer.get_output_port(), gyroscope.get_output_port()]
    if any(sizes):
        source = add("noise", RandomSource(RandomDistribution.kGaussian, 6, period))
        scaled = add("scaled_noise", MatrixGain(np.diag(np.repeat(sizes, 3))))
        both, noisy = add("sensed", Multiplexer([3, 3])), add("with_noise", Adder(2, 6))
        split = add("force_and_rate", Demultiplexer([3, 3]))
        connect(source.get_output_port(), scaled.get_input_port())
        for k, port in enumerate(sensed):
            connect(port, both.get_input_port(k))
        for k, part in enumerate((both, scaled)):
            connect(part.get_output_port(), noisy.get_input_port(k))
        connect(noisy.get_output_port(), split.get_input_port())
        sensed = [split.get_output_port(k) for k in range(2)]
    observer = add("observer", orientation_observer(model=model))
    for port, name in zip(sensed, ("specific_force", "angular_rate"), strict=True):
        connect(port, observer.GetInputPort(name))
        builder.ExportOutput(port, name)

    def roll_and_pitch(down: Symbols) -> list[sym.Expression]:
        x, y, z = down
        return [sym.atan2(-y, -z), sym.atan2(-x, sym.sqrt(y * y + z * z))]

    attitude = add("attitude", symbolic_law(
        inputs={"gravity": 3}, output="felt_attitude", law=roll_and_pitch
    ))  # fmt: skip
    connect(observer.GetOutputPort("gravity"), attitude.get_input_port())
    builder.ExportOutput(observer.GetOutputPort("gravity"), "felt_gravity")
    builder.ExportOutput(observer.GetOutputPort("rate"), "felt_rate")
    builder.ExportOutput(attitude.get_output_port(), "felt_attitude")
    return build(builder, "pilot_at_head")


def add_pilot(builder: DiagramBuilder, design: Design, device: System) -> Mapping[str, OutputPort]:
    """Add the pilot of a design to its loop, and return the outputs by name.

    Args:
        builder: builder of the loop.
        design: the design of the loop, on the coupled plant.
        device: the device with outputs of its bodies.
    """
    choice = design.scenario.pilot
    pilot = pilot_at_head(
        robot=design.device.simulated,
        model=load_perception(choice.model or BY_DEFAULT),
        period=design.reference.held.period,
        force_noise=choice.force_noise,
        rate_noise=choice.rate_noise,
    )
    builder.AddNamedSystem("pilot", pilot)
    for name in _BODIES:
        builder.Connect(device.GetOutputPort(name), pilot.GetInputPort(name))
    ports = map(pilot.get_output_port, range(pilot.num_output_ports()))
    return {port.get_name(): port for port in ports}


def start_pilot(pilot: Diagram, context: Context, design: Design) -> None:
    """Set the observer to the force and rate of the start, long felt, and seed the noise."""
    force, rate = (
        np.array(sensor.get_output_port().Eval(pilot.GetSubsystemContext(sensor, context)))
        for sensor in map(pilot.GetSubsystemByName, ("accelerometer", "gyroscope"))
    )
    observer = cast(Diagram, pilot.GetSubsystemByName("observer"))
    set_unfelt(observer, pilot.GetMutableSubsystemContext(observer, context), force, rate)
    if pilot.HasSubsystemNamed("noise"):
        source = pilot.GetSubsystemByName("noise")
        own = pilot.GetMutableSubsystemContext(source, context)
        source.SetRandomContext(own, RandomGenerator(design.scenario.pilot.seed))
