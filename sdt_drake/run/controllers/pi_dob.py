"""PI speed controllers with a disturbance observer."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import Adder, Gain

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import EachJoint, Positive, field
from sdt_drake.motion import Motion
from sdt_drake.run.controllers.pi import WeightedPi
from sdt_drake.run.design import Design
from sdt_drake.systems import disturbance_observer
from sdt_drake.systems.disturbance_observer import set_disturbance
from sdt_drake.systems.wiring import nested


@dataclass(frozen=True)
class PiDob(WeightedPi):
    """PI speed controllers that add the disturbance which an observer finds for each motor.

    The observer compares the torque with the measured acceleration, by the largest inertia of the
    joint. It knows neither links nor loads, and no feedforward: a torque that others add is to it a
    disturbance like any other. What the saturation cuts is no disturbance.

    .. pydrake_system::

        name: pi_dob
        input_ports: [reference, measured, tau_cmd, tau_limited]
        output_ports: [tau_fb]
    """

    kind: Literal["pi_dob"] = "pi_dob"
    observer_bandwidth: EachJoint[Positive] | None = field(None, unit="rad/s")
    """Bandwidth g of the observer; omega_n by default."""

    takes_feedforward = False

    def _bandwidth(self, design: Design) -> Array:
        own = self.observer_bandwidth
        return design.tuning.omega_n if own is None else np.array(own)

    def behind(
        self, builder: DiagramBuilder, design: Design, tau_fb: OutputPort, sample: int | None
    ) -> OutputPort:
        robot, n = design.device.simulated, design.device.simulated.n
        add, connect = builder.AddNamedSystem, builder.Connect
        observer = add("disturbance_observer", disturbance_observer(
            inertia=design.tuning.inertia.maximum,
            bandwidth=self._bandwidth(design),
            gear_ratio=robot.gear_ratio,
            motor_torque_limit=robot.motor_torque_limit,
            period=design.drive.period,
        ))  # fmt: skip
        total = add("tau_fb", Adder(2, n))
        connect(tau_fb, total.get_input_port(0))
        connect(observer.get_output_port(), total.get_input_port(1))
        builder.ConnectInput("measured", observer.GetInputPort("measured"))
        if sample is not None:  # nothing saturates
            connect(total.get_output_port(), observer.GetInputPort("tau"))
            return total.get_output_port()
        given, minus = add("given", Adder(3, n)), add("minus_tau_cmd", Gain(-1.0, n))
        connect(total.get_output_port(), given.get_input_port(0))
        for name, port in (
            ("tau_cmd", minus.get_input_port()),
            ("tau_limited", given.get_input_port(2)),
        ):
            if self.anti_windup:
                builder.ConnectInput(name, port)
            else:
                builder.ExportInput(port, name)
        connect(minus.get_output_port(), given.get_input_port(1))
        connect(given.get_output_port(), observer.GetInputPort("tau"))
        return total.get_output_port()

    def start(
        self, system: System, context: Context, design: Design, tau: Array, start: Motion | None
    ) -> None:
        super().start(system, context, design, 0 * tau, start)  # the observer gives all of it
        v = (design.reference.tracked if start is None else start).v[0]
        self.start_filters(system, context, design, tau, v)
        robot, g = design.device.simulated, self._bandwidth(design)
        observer = nested(system, context, "disturbance_observer")
        momentum = g * design.tuning.inertia.maximum * robot.gear_ratio
        limit = robot.motor_torque_limit
        set_disturbance(*observer, tau, v, momentum=momentum, motor_torque_limit=limit)

    def in_words(self, design: Design) -> str:
        return f"{super().in_words(design)} with a disturbance observer"
