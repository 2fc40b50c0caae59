"""A block alone: in a diagram of its own, with its context, and without a simulator."""

from __future__ import annotations

import numpy as np

from sdt_drake.control import SpeedGains
from sdt_drake.device import FrictionParameters, Springs
from sdt_drake.dynamics import Loads
from sdt_drake.motion import Motion
from sdt_drake.systems import (
    Envelope,
    axis_process_block,
    constant_block,
    ctc_feedforward_block,
    disturbance_block,
    dynamic_saturation_block,
    elastic_joints_block,
    encoder_block,
    feedforward_torque_block,
    friction_block,
    gain_schedule_block,
    inverse_dynamics_block,
    load_torque_block,
    make_block,
    pi_speed_controller_block,
    position_loop_block,
    reference_source_block,
    robot_plant_block,
    table_block,
    torque_loop_block,
    true_load_block,
    zero_order_hold_block,
)

PERIOD = 0.005  # s
GEAR = np.array([67.2, 1.0, 3.5])
N = len(GEAR)
LIMIT = np.array([203.2, 3950.0, 0.3])  # N m
GAINS = SpeedGains(kp=np.array([3.0, 40.0, 500.0]), ki=np.array([20.0, 300.0, 4000.0]))
ENVELOPE = Envelope(np.array([100.0, 2.0, 7.0]), np.array([200.0, 5.0, 8.0]), GEAR)
FRICTION = FrictionParameters(
    coulomb=np.array([500.0, 90.0, 2.0]),
    viscous=np.array([30.0, 0.0, 0.1]),
    breakaway=np.array([750.0, 90.0, 3.5]),
    stribeck_speed=0.02,
    presliding=1e-5,
)
SPRINGS = Springs(
    elastic=np.array([True, False, True]),
    stiffness=np.array([9e5, 0.0, 4e3]),
    damping=np.array([700.0, 0.0, 5.0]),
)
ROTORS = np.array([0.13, 1.7, 0.5])  # kg m²

# Speeds that jump from sample to sample: any sample but the right one is far off.
_RNG = np.random.default_rng(4)
MOTION = Motion.from_speeds(PERIOD, _RNG.normal(size=N), _RNG.normal(size=(3001, N)))
LOADS = Loads(_RNG.normal(size=MOTION.q.shape), _RNG.normal(size=MOTION.q.shape))

# What each block needs to be made; `robot` and `model` come from the fixture.
ARGUMENTS = {
    axis_process_block: {"i_eff": [2.0, 5.0, 9.0], "gear_ratio": GEAR},
    constant_block: {"signal": "(signal)", "value": [1.0, -2.0]},
    ctc_feedforward_block: {"n": N},
    disturbance_block: {"n": N, "amplitude": 0.05, "omega_d": 7.0},
    dynamic_saturation_block: {"motor_torque_limit": [100.0] * N},
    elastic_joints_block: {"springs": SPRINGS, "rotor_inertia": ROTORS, "gear_ratio": GEAR},
    encoder_block: {"n": N, "period": PERIOD},
    feedforward_torque_block: {
        "model": None,
        "feedforward": "id",
        "sign": "consistent",
        "gain": np.ones(4),
        "friction": np.zeros_like,
    },
    friction_block: {"friction": FRICTION, "gear_ratio": GEAR},
    gain_schedule_block: {"n": N},
    inverse_dynamics_block: {
        "model": None,
        "omega_n": [9.0, 10.0, 11.0, 12.0],
        "zeta": [1.0, 0.9, 0.8, 0.7],
    },
    load_torque_block: {"robot": None, "sign": "printed"},
    pi_speed_controller_block: {"gains": GAINS, "gear_ratio": GEAR},
    position_loop_block: {"position_gain": [2.0, 3.0, 5.0]},
    reference_source_block: {"motion": MOTION},
    robot_plant_block: {"robot": None},
    table_block: {"motion": MOTION, "signals": {"(signals)": MOTION.v}},
    torque_loop_block: {"motor_torque_limit": LIMIT},
    true_load_block: {"n": N},
    zero_order_hold_block: {"size": 3 * N, "period": PERIOD},
}


def arguments_of(describe, robot, **changes):
    """All that a block needs, with `robot` where it needs one."""
    arguments = {**ARGUMENTS[describe], **changes}
    return {
        name: robot if value is None and name in ("robot", "model") else value
        for name, value in arguments.items()
    }


class Alone:
    """A block in a diagram of its own, with its context."""

    def __init__(self, describe, robot=None, **changes):
        self._take(make_block("alone", describe, **arguments_of(describe, robot, **changes)))

    @classmethod
    def of(cls, diagram):
        """The same of a diagram of several blocks."""
        alone = cls.__new__(cls)
        alone._take(diagram)
        return alone

    def _take(self, diagram):
        self.diagram = diagram
        self.context = diagram.CreateDefaultContext()

    def give(self, **inputs):
        """Fix input ports."""
        for name, value in inputs.items():
            port = self.diagram.GetInputPort(name)
            port.FixValue(self.context, np.asarray(value, dtype=float))

    def output(self, name):
        return self.diagram.GetOutputPort(name).Eval(self.context)

    def derivatives(self):
        return self.diagram.EvalTimeDerivatives(self.context).CopyToVector()

    @property
    def timing(self):
        """Offset and period of its samples [s]."""
        timing = self.diagram.GetUniquePeriodicDiscreteUpdateAttribute()
        return timing.offset_sec(), timing.period_sec()

    def sample(self, time=None):
        """Let the periodic update happen."""
        if time is not None:
            self.context.SetTime(time)
        update = self.diagram.EvalUniquePeriodicDiscreteUpdate(self.context)
        self.context.SetDiscreteState(update)

    def passes(self, source, target):
        """Whether an input acts on an output at once."""
        return self.diagram.HasDirectFeedthrough(
            self.diagram.GetInputPort(source).get_index(),
            self.diagram.GetOutputPort(target).get_index(),
        )


def exact(actual, expected):
    np.testing.assert_array_equal(actual, expected)


def close(actual, expected):
    np.testing.assert_allclose(actual, expected, rtol=1e-12, atol=1e-12)


def inputs_of(system):
    ports = map(system.get_input_port, range(system.num_input_ports()))
    return {port.get_name(): port for port in ports}


def outputs_of(system):
    ports = map(system.get_output_port, range(system.num_output_ports()))
    return {port.get_name(): port for port in ports}
