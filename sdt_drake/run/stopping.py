"""One emergency stop of the coupled plant: joints coast, follow a ramp of their drive, or brake."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, System
from pydrake.systems.primitives import Adder

from sdt_drake.io.arrays import Array, Mask
from sdt_drake.robot.brakes import Brakes
from sdt_drake.robot.device import FrictionParameters
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.stops import Stops
from sdt_drake.run.simulate import make_simulator, new_integrator
from sdt_drake.systems.friction import joint_friction, set_sliding
from sdt_drake.systems.joint_stops import joint_stops
from sdt_drake.systems.robot_plant import add_robot_plant
from sdt_drake.systems.wiring import build, nested

SAMPLE = 0.01
"""Longest time between two samples of a stop [s]."""

AT_REST = 1e-3
"""Largest speed [rad/s] and acceleration [rad/s²] of a free joint that is at rest."""

_DRIVEN, _STILL = 1e9, 1e30  # inertia of a held joint over that of its links
_STUCK = 1e-6  # rad/s; a slower joint sticks where its speed changes its sign
_IN_TIME = 1e-9  # s; accuracy of that instant


@dataclass(frozen=True, eq=False)
class Schedule:
    """The events of each joint in a stop: times since it began [s], shape (n,) each."""

    ramp: Array
    """Duration of the drive's ramp to rest, with constant deceleration."""
    released: Array
    """Time from which on the drive has no torque; 0 at once, inf never."""
    closed: Array
    """Time from which on the brake has its torque, once the drive has none; inf never."""

    @property
    def events(self) -> Array:
        """All finite times, in order."""
        times = np.unique([self.ramp, self.released, self.closed])
        return times[np.isfinite(times)]


@dataclass(frozen=True, eq=False)
class Course:
    """The course of a stop, joint side. Where accelerations jump, two samples have one time."""

    time: Array
    """Time since the stop began [s], shape (N,)."""
    q: Array
    """Positions [rad], shape (N, n)."""
    v: Array
    """Speeds [rad/s], shape (N, n)."""
    vd: Array
    """Accelerations [rad/s²], shape (N, n)."""
    torque: Array
    """Torque of drive or brake on each joint, with the inertia of motors [N m], shape (N, n)."""
    driven: Mask
    """True where it is the torque of the drive, shape (N, n)."""
    resting: Mask
    """True for joints at rest, shape (N, n)."""

    @property
    def stopping_time(self) -> Array:
        """Time from which on each joint rests [s], shape (n,); inf if it moves at the end."""
        last = len(self.time) - np.argmax(~self.resting[::-1], axis=0)  # after the last in motion
        times = np.append(self.time, np.inf)[last]
        return np.where(self.resting.all(axis=0), 0.0, times)

    @property
    def angle(self) -> Array:
        """Largest angle from where each joint was when the stop began [rad], shape (n,).

        Where a joint turns back between two samples, its speed there is a straight line.
        """
        before, change = self.v[:-1], np.diff(self.v, axis=0)
        ahead = np.diff(self.time)[:, None] * before**2 / 2
        turns = before * self.v[1:] < 0
        beyond = np.divide(-ahead, change, out=np.zeros_like(ahead), where=turns)
        extremes = np.vstack([self.q, self.q[:-1] + beyond])
        return np.asarray(np.abs(extremes - self.q[0]).max(axis=0))

    @property
    def brake_energy(self) -> Array:
        """Work that each brake takes from its joint [J], shape (n,)."""
        power = np.where(self.driven, 0.0, -self.torque * self.v)
        return np.trapezoid(power, self.time, axis=0)


class StopPlant:
    """The coupled plant without controller, to simulate stops one after another in one thread.

    A held joint has 1e9 times its inertia on a ramp, and 1e30 times at rest. So it accelerates as
    its drive tells it to, or not at all, and the acceleration that it lacks is the torque of its
    drive or brake.
    """

    def __init__(
        self,
        robot: Robot,
        brakes: Brakes,
        friction: FrictionParameters | None = None,
        stops: Stops | None = None,
        *,
        accuracy: float = 1e-4,
    ) -> None:
        """Make the plant.

        Args:
            robot: the robot; each of its motors turns with one joint.
            brakes: brakes of its motors.
            friction: friction of its joints, if any.
            stops: stops of its joints that push back, if any.
            accuracy: accuracy of speeds [rad/s].
        """
        builder = DiagramBuilder()
        ports = add_robot_plant(builder, robot=robot)
        builder.ExportInput(ports.tau, "tau")
        loads: dict[str, System] = {}
        ratio, ends = robot.gear_ratio, (robot.position_lower, robot.position_upper)
        if friction is not None:
            loads["friction"] = joint_friction(friction=friction, gear_ratio=ratio)
        if stops is not None and not stops.is_none:
            loads["joint_stops"] = joint_stops(
                stops=stops, lower=ends[0], upper=ends[1], gear_ratio=ratio
            )
        total = builder.AddNamedSystem("load", Adder(len(loads) + 1, robot.n))
        for k, (name, load) in enumerate(loads.items()):
            builder.AddNamedSystem(name, load)
            builder.Connect(ports.state, load.get_input_port())
            builder.Connect(load.get_output_port(), total.get_input_port(k + 1))
        builder.ExportInput(total.get_input_port(0), "extra_load_torque")
        builder.Connect(total.get_output_port(), ports.load_torque)
        self._diagram = diagram = build(builder, "stop_plant")
        self._simulator = make_simulator(diagram, period=SAMPLE, accuracy=accuracy)
        self._context = context = self._simulator.get_mutable_context()
        self._plant = plant = cast(MultibodyPlant, diagram.GetSubsystemByName("multibody_plant"))
        self._of_plant = diagram.GetMutableSubsystemContext(plant, context)
        self._actuators = [plant.get_joint_actuator(k) for k in plant.GetJointActuatorIndices()]
        self._tau = diagram.GetInputPort("tau")
        diagram.GetInputPort("extra_load_torque").FixValue(context, np.zeros(robot.n))
        self.robot, self.brakes = robot, brakes
        self._friction, self._accuracy = friction, accuracy
        self._inertia = robot.reflected_inertia + brakes.inertia
        self._links = robot.plant.CalcMassMatrix(robot.context_at_zero()).diagonal()

    def begin(self, q: Array, v: Array) -> None:
        """Set time 0, positions [rad] and speeds [rad/s], with steady friction at that speed."""
        new_integrator(self._simulator, SAMPLE, self._accuracy)
        self._context.SetTime(0.0)
        self._plant.SetPositionsAndVelocities(self._of_plant, np.concatenate([q, v]))
        if self._friction is not None:
            block = nested(self._diagram, self._context, "friction")
            set_sliding(*block, v, friction=self._friction)
        self._simulator.Initialize()

    @property
    def v(self) -> Array:
        """Speeds now [rad/s], shape (n,)."""
        return np.asarray(self._plant.GetVelocities(self._of_plant))

    def rest(self, joints: Mask) -> None:
        """Set the speed of some joints to 0."""
        self._plant.SetVelocities(self._of_plant, np.where(joints, 0.0, self.v))

    def hold(self, held: Mask, vd: Array, torque: Array) -> None:
        """Hold some joints at accelerations vd [rad/s²]; others have a torque, joint side [N m]."""
        ratio = self.robot.gear_ratio
        large = np.where(vd == 0, _STILL, _DRIVEN) * self._links
        for actuator, own in zip(
            self._actuators, np.where(held, large, self._inertia) / ratio**2, strict=True
        ):
            actuator.SetRotorInertia(self._of_plant, own)
        self._set = held, large, vd, torque
        tau = np.where(held, large * vd, torque) / ratio
        self._tau.FixValue(self._context, tau)

    def acting(self) -> tuple[Array, Array]:
        """Return accelerations [rad/s²], and torques of drives and brakes, joint side [N m]."""
        vd = np.array(self._plant.get_generalized_acceleration_output_port().Eval(self._of_plant))
        held, large, wanted, torque = self._set
        return vd, np.where(held, large * (wanted - vd) + self._inertia * vd, torque)

    def advance(self, until: float) -> None:
        """Simulate until a time [s]."""
        self._simulator.AdvanceTo(until, interruptible=False)

    def locate(self, way: Array, start: tuple[float, Array]) -> None:
        """Go back to the first instant since `start` at which a joint moves in its `way` no more.

        Args:
            way: direction of each joint that slides in its brake, 1 or -1; 0 for others.
            start: time [s] and state at a time before that instant, from `now`.
        """
        until = self._context.get_time()
        self._go(start, start[0])
        sliding = (way != 0) & (way * self.v > _STUCK)  # others have just begun to slide

        def forward(time: float) -> float:
            self._go(start, time)
            return float(np.min((way * self.v)[sliding], initial=np.inf))

        if forward(until) < 0:
            from scipy.optimize import brentq

            forward(brentq(forward, start[0], until, xtol=_IN_TIME))

    def now(self) -> tuple[float, Array]:
        """Return time and state: positions and speeds come first."""
        return self._context.get_time(), self._context.get_continuous_state_vector().CopyToVector()

    def _go(self, start: tuple[float, Array], until: float) -> None:
        self._context.SetTimeAndContinuousState(*start)
        self._simulator.Initialize()
        self.advance(until)


def simulate_stop(
    plant: StopPlant, q: Array, v: Array, schedule: Schedule, longest: float
) -> Course:
    """Simulate a stop until all joints rest.

    A closed brake has its dynamic torque against the motion. Where the speed of its joint changes
    sign, the joint sticks, until it is loaded with more than the static torque. So nothing chatters
    or creeps.

    Args:
        plant: the plant.
        q: positions when the stop begins, joint side [rad], shape (n,).
        v: speeds then [rad/s], shape (n,).
        schedule: what happens to the joints.
        longest: time after which the simulation ends in any case [s].
    """
    static, dynamic = plant.brakes.static, plant.brakes.dynamic
    n = len(v)
    slope = np.divide(-v, schedule.ramp, out=np.zeros(n), where=schedule.ramp > 0)
    way, stuck = np.zeros(n), np.zeros(n, dtype=bool)  # of joints in closed brakes
    time, events, rows = 0.0, schedule.events, []

    def record() -> bool:
        """Store a sample; return whether a joint is due to slide or to stick."""
        (at, state), (vd, torque) = plant.now(), plant.acting()
        speed, driven = state[n : 2 * n], at < schedule.released
        free = (np.abs(speed) <= AT_REST) & (way == 0)
        resting = stuck | np.where(driven, at >= schedule.ramp, free)
        rows.append((at, state[:n], speed, vd, torque, driven, resting))
        slides = stuck & (np.abs(torque) > static)
        return bool((slides | (way != 0) & (way * speed <= _STUCK)).any())

    def settle() -> None:
        """Let each joint follow its drive, slide in its brake or stick, as is due now."""
        driven, speed = time < schedule.released, plant.v
        closed = ~driven & (time >= schedule.closed) & ~stuck
        way[closed & (way == 0)] = np.sign(speed)[closed & (way == 0)]
        sticks = closed & (way * speed <= _STUCK)
        stuck[sticks], way[sticks] = True, 0.0
        plant.rest(stuck | driven & (time >= schedule.ramp))
        while True:
            vd = np.where(driven & (time < schedule.ramp), slope, 0.0)
            plant.hold(driven | stuck, vd, -way * dynamic)
            torque = plant.acting()[1]
            slides = stuck & (np.abs(torque) > static)
            if not slides.any():
                return
            stuck[slides], way[slides] = False, -np.sign(torque[slides])

    plant.begin(q, v)
    settle()
    record()
    while time < longest:
        *_, vd, _, _, resting = rows[-1]
        if time >= events[-1] and resting.all() and (np.abs(vd) <= AT_REST).all():
            break  # all joints rest, and none is about to turn back
        start = plant.now()
        plant.advance(min([time + SAMPLE, longest, *events[events > time][:1]]))
        if (way * plant.v < 0).any():
            plant.locate(way, start)
        is_due = record()
        time = rows[-1][0]
        if is_due or time in events:
            settle()
            record()
    return Course(*map(np.array, zip(*rows, strict=True)))
