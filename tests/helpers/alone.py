"""A block alone: what it is made from, and how it is asked without a simulator."""

import numpy as np

from sdt_drake import pilot, systems
from sdt_drake.motion import Motion
from sdt_drake.pilot.observer import PerceptionModel
from sdt_drake.robot.device import FrictionParameters, Springs
from sdt_drake.robot.dynamics import Loads
from sdt_drake.robot.stops import Stops
from sdt_drake.robot.windings import Windings
from sdt_drake.systems.gains import SpeedGains

PERIOD = 0.005  # s
GEAR = np.array([67.2, 1.0, 3.5])
N = len(GEAR)
LIMIT = np.array([203.2, 3950.0, 0.3])  # N m
GAINS = SpeedGains(kp=np.array([3.0, 40.0, 500.0]), ki=np.array([20.0, 300.0, 4000.0]))
N1, N0 = np.array([100.0, 2.0, 7.0]), np.array([200.0, 5.0, 8.0])  # rad/s
ENVELOPE = {"gear_ratio": GEAR, "n1": N1, "n0": N0}
FRICTION = FrictionParameters(
    coulomb=np.array([500.0, 90.0, 2.0]),
    viscous=np.array([30.0, 0.0, 0.1]),
    breakaway=np.array([750.0, 90.0, 3.5]),
    stribeck_speed=np.array([0.02, 0.3, 0.01]),
    presliding=1e-5,
    offset=np.array([-200.0, 40.0, 0.5]),
)
STOPS = Stops(stiffness=[5e4, 0.0, 30.0], damping=[600.0, 7.0, 0.1], restitution=0.6)
LOWER, UPPER = np.array([-0.5, -0.1, -np.inf]), np.array([0.4, 0.2, 0.3])  # rad
WINDINGS = Windings(
    rated_torque=np.array([68.0, 1780.0, 0.1]),
    rise=np.array([105.0, 80.0, 60.0]),
    limit=np.array([155.0, 130.0, 120.0]),
    time_constant=np.array([[90.0, 180.0, 20.0], [2700.0, 900.0, 20.0]]),
    share=np.array([[0.6, 0.75, 1.0], [0.4, 0.25, 0.0]]),
    coolant=25.0,
    initial=40.0,
)
STIFFNESS, DAMPING = np.array([[9e5, 0.0, 4e3], [700.0, 0.0, 5.0]])
SPRINGS = Springs(elastic=STIFFNESS > 0, stiffness=STIFFNESS, damping=DAMPING)
ROTORS = np.array([0.13, 1.7, 0.5])  # kg m²
I_EFF = np.array([2.0, 5.0, 9.0])  # kg m²
OMEGA_N, ZETA = np.array([9.0, 10.0, 11.0, 12.0]), np.array([1.0, 0.9, 0.8, 0.7])
RESOLVED = {"resolution": [50.0, 60.0, 70.0], "gear_ratio": GEAR}
ERROR = np.array([0.05, -0.1, 0.0])
FEELING = PerceptionModel(
    source="of no one",
    k_w=[2.0, 3.0, 8.0],
    k_fw=[1.0, 0.0, 5.0],
    k_fg=[4.0, 2.0, 3.0],
    k_a=[-4.0, -2.0, 0.0],
    tau=[6.7, 7.3, 5.7],
    tau_a=[60.0, 70.0, 80.0],
    cutoff=1.5,
)

# Speeds that jump from sample to sample: any sample but the right one is far off.
_RNG = np.random.default_rng(4)
MOTION = Motion.from_speeds(PERIOD, _RNG.normal(size=N), _RNG.normal(size=(3001, N)))
LOADS = Loads(_RNG.normal(size=MOTION.q.shape), _RNG.normal(size=MOTION.q.shape))

# What each block needs to be made; `robot` and `model` come from the fixture.
ARGUMENTS = {
    "axis_process": {"i_eff": I_EFF, "gear_ratio": GEAR},
    "disturbance": {"n": N, "amplitude": 0.05, "omega_d": 7.0},
    "disturbance_observer": {
        "inertia": I_EFF,
        "bandwidth": [9.0, 20.0, 40.0],
        "gear_ratio": GEAR,
        "motor_torque_limit": LIMIT,
    },
    "dynamic_saturation": {"motor_torque_limit": [100.0] * N},
    "elastic_joints": {"springs": SPRINGS, "rotor_inertia": ROTORS, "gear_ratio": GEAR},
    "encoder": {"n": N, "period": PERIOD},
    "gain_schedule": {"n": N},
    "internal_model": {"model": FEELING},
    "gear_loss": {"efficiency": [0.9, 0.6, 1.0]},
    "inverse_dynamics_controller": {"model": None, "omega_n": OMEGA_N, "zeta": ZETA},
    "joint_friction": {"friction": FRICTION, "gear_ratio": GEAR},
    "joint_stops": {"stops": STOPS, "lower": LOWER, "upper": UPPER, "gear_ratio": GEAR},
    "LoadTorque": {"robot": None},
    "motor_windings": {"windings": WINDINGS},
    "orientation_observer": {"model": FEELING},
    "pilot_at_head": {"robot": None, "model": FEELING, "period": PERIOD},
    "pi_speed_controller": {"gains": GAINS, "gear_ratio": GEAR},
    "position_loop": {"position_gain": [2.0, 3.0, 5.0]},
    "reference_source": {"motion": MOTION},
    "ReferenceTorque": {
        "robot": None,
        "outputs": ("(torques)",),
        "law": lambda groups, v, vd: [sum(groups) + v + vd],
    },
    "robot_drawing": {"robot": None, "meshcat": None},
    "robot_plant": {"robot": None},
    "signal_table": {"motion": MOTION, "signals": {"(signals)": MOTION.v}},
    "symbolic_law": {"inputs": {"a": 2}, "output": "b", "law": lambda a: [a[0] * a[1]]},
    "torque_ripple": {
        "harmonics": [1.0, 6.0],
        "amplitudes": [0.1, 0.02],
        "gear_ratio": GEAR,
        "motor_torque_limit": LIMIT,
    },
    "torque_loop": {"motor_torque_limit": LIMIT},
}


def block(name):
    """The class or function of a block, by its name."""
    return getattr(pilot if name in pilot.__all__ else systems, name)


def made(name, robot=None, **changes):
    """A block by the name of its class or function; with `robot` where it needs one."""
    arguments = {**ARGUMENTS[name], **changes}
    for key in ("robot", "model"):
        if key in arguments and arguments[key] is None:
            arguments[key] = robot
    return block(name)(**arguments)


class Alone:
    """A system with its own context."""

    def __init__(self, system, robot=None, **changes):
        self.system = made(system, robot, **changes) if isinstance(system, str) else system
        self.context = self.system.CreateDefaultContext()

    def give(self, **inputs):
        """Fix input ports."""
        for name, value in inputs.items():
            port = self.system.GetInputPort(name)
            port.FixValue(self.context, np.asarray(value, dtype=float))

    def output(self, name):
        return self.system.GetOutputPort(name).Eval(self.context).copy()

    def derivatives(self):
        return self.system.EvalTimeDerivatives(self.context).CopyToVector()

    @property
    def timing(self):
        """Offset and period of its samples [s]."""
        timing = self.system.GetUniquePeriodicDiscreteUpdateAttribute()
        return timing.offset_sec(), timing.period_sec()

    def sample(self, time=None):
        """Let the periodic update happen."""
        if time is not None:
            self.context.SetTime(time)
        update = self.system.EvalUniquePeriodicDiscreteUpdate(self.context)
        self.context.SetDiscreteState(update)


def exact(actual, expected):
    np.testing.assert_array_equal(actual, expected)


def inputs_of(system):
    ports = map(system.get_input_port, range(system.num_input_ports()))
    return {port.get_name(): port for port in ports}


def outputs_of(system):
    ports = map(system.get_output_port, range(system.num_output_ports()))
    return {port.get_name(): port for port in ports}
