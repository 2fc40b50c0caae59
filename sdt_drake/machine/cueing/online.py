"""Cueing of a flight as it comes, as a Drake block: a receding-horizon program or a washout.

At each knot the block plans 3 s of motion, from where the plan so far will be at the next knot. The
gimbals of the plan end at rest, and a stop of the arm follows. A new plan is taken if it keeps all
limits, its stop included. Else the plan so far goes on, to its stop at the worst.

The flight to come is not known: its force is held, and its rate fades. The program minimises the
cost of `program` over these 3 s. The washout comes near the angles of a classical one by the same
means, so it keeps the same limits.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any
from weakref import proxy

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, State

from sdt_drake.io.arguments import finite, finite_number, one_of, positive, share, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.cueing.alignment import TILT, WASHOUT, nearer, standing, turned
from sdt_drake.machine.cueing.felt import advanced, felt, followed, unfelt
from sdt_drake.machine.cueing.problem import (
    Problem,
    Trajectory,
    Weights,
    check_program,
    has_arm,
    resultant,
)
from sdt_drake.machine.cueing.program import solve
from sdt_drake.motion.plan import INTERPOLATION_PERIOD
from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.observer import PerceptionModel, load_perception
from sdt_drake.robot.robot import Robot, load_robot

LAWS = ("program", "washout")
"""Laws of the cueing."""

IDLE_G = 1.4
"""Resultant with a turning arm before a flight, by default [G]."""

HORIZON = 3.0
"""Duration of a plan before its stop [s]."""

STOPS = (2.0, 4.0, 8.0, 16.0)
"""Durations of the stop behind a plan, tried in turn [s]."""

_FADE = 3.0  # time constant with which the rate fades in the flight to come [s]
_STEPS = 3  # largest number of steps of Gauss and Newton for a plan
_RESERVE = 0.03  # distance from the limits at knots, as a share
_MOST = 1000.0  # largest force and rate that may be a flight's [m/s², rad/s]
_OFF = 0.02  # difference of the first force [G]


@dataclass(frozen=True, eq=False)
class _Washout:
    """Aligned angles, and the low passes of a washout; an arm has its speed as its angle."""

    aligned: Array
    tilt: Array
    rate: Array


@dataclass(frozen=True, eq=False)
class _State:
    """The plan from a knot on, and what the pilot feels."""

    time: float
    """Time of that knot [s]; inf before the first plan."""
    plan: Trajectory
    """Plan from that knot to rest."""
    on_device: Array
    """State of the observer on the device at the next knot, shape (12,)."""
    head: Array
    """Force and rate in flight, shape (6,)."""
    in_flight: Array | None
    """State of the observer in flight, shape (12,); None without a sample."""
    washout: _Washout
    computing_share: float = 0.0
    """Computing time of the plan over the time between knots [-]."""
    is_kept: bool = False
    """True if the plan so far goes on."""

    @property
    def later(self) -> _State:
        """The state one knot later, where the plan goes on."""
        rest = len(self.plan.q) < 3
        parts = (np.vstack([x[1:], x[-1:]]) if rest else x[1:] for x in self.plan.parts)
        plan = _trajectory(self.plan.knot, parts)
        return replace(self, plan=plan, is_kept=True)


class OnlineCueing(LeafSystem):
    """Reference of a device from the motion of a pilot's head in flight, as it comes.

    `flight` is [specific force, angular rate] of the head (x forward, y left, z up) [m/s², rad/s].
    `reference` is [q, v, vd] of the joints, held for a period, for a loop with an external one.
    While the input is not finite, or beyond 1000, there is no new plan, and the device comes to a
    stop.
    `computing_share` is the computing time of the last plan over the time between plans [-], and
    `is_kept` is 1 if the plan before it goes on. State: the plan, the observers on the device and
    in flight, the reference, and the smoothed input.

    .. pydrake_system::

        name: OnlineCueing
        input_ports: [flight]
        output_ports: [reference, computing_share, is_kept]
    """

    __slots__ = ()  # pydrake never frees a system with a second __dict__

    @takes(
        up=finite("(3,)"), idle_g=resultant, seat=finite_number, knot=positive, period=positive,
        torque_margin=share,
    )  # fmt: skip
    def __init__(
        self,
        robot: Robot | str = "sdt",
        *,
        law: str = "program",
        idle_g: float | None = None,
        sense: int = 1,
        seat: float = 0.0,
        up: Array | None = None,
        perception: PerceptionModel | str = "slow_yaw",
        weights: Weights = Weights(0.3, 1.0, 1.0, 0.1),  # noqa: B008  # frozen
        torque_margin: float = 0.95,
        knot: float = 0.2,
        period: float = INTERPOLATION_PERIOD,
    ) -> None:
        """Make the block.

        Args:
            robot: A device with a head, or its file or name.
            law: "program", or "washout" for a classical washout.
            idle_g: Resultant at the start, with a turning arm [G]; 1 for a device at rest. By
                default 1.4, or 1 if the device cannot hold that along `up`.
            sense: Sense of rotation of the arm, 1 or -1.
            seat: Angle of the last joint from which the first posture is found [rad]; pi looks the
                other way along the arm's circle.
            up: Direction of the force at the start, in axes of the head, shape (3,); z by default.
            perception: Perception model of the pilot, or its name.
            weights: Weights of the errors in the program.
            torque_margin: Share of the motors' torque to use [-].
            knot: Time between plans, and between the knots of a plan [s].
            period: Sample period of the reference [s].

        Raises:
            InputError: The device has no head, or cannot begin with `idle_g`.
        """
        super().__init__()
        robot = robot if isinstance(robot, Robot) else load_robot(robot)
        if not isinstance(perception, PerceptionModel):
            perception = load_perception(perception)
        one_of(law, "law", LAWS)
        up = np.array([0.0, 0.0, 1.0]) if up is None else up
        if up.shape != (3,) or not up.any():
            raise InputError(f"{up.tolist()}, expected a direction of 3 numbers", place="up")
        if sense not in (1, -1):
            raise InputError(f"{sense}, expected 1 or -1", place="sense")
        check_program(robot, knot, period)
        count, ends = round(HORIZON / knot) + 1, (robot.position_lower, robot.position_upper)
        turns = has_arm(robot) and bool(np.isinf([ends[0][0], ends[1][0]]).all())
        self._problem = Problem(
            robot=robot, model=perception, knot=knot, head=np.zeros((count, 6)),
            felt=np.zeros((count, 9)), weight=np.ones((count, 2)), weights=weights,
            torque_share=torque_margin, lower=ends[0], upper=ends[1], arm=turns, shift=_RESERVE,
        )  # fmt: skip
        self._law, self._spin = law, np.array([float(sense)])
        self.knot, self.period, self.idle_g = knot, period, idle_g or IDLE_G
        up = up / np.linalg.norm(up)
        try:
            self.start = self._idle(up, seat)
        except InputError:
            if idle_g:
                raise
            self.idle_g = 1.0
            self.start = self._idle(up, seat)
        self._declare()

    def _declare(self) -> None:
        """Declare states, ports and events."""
        block: Any = proxy(self)  # Drake keeps functions forever that refer to their own system
        knot, period = self.knot, self.period
        flight = self.DeclareVectorInputPort("flight", 6)
        steady = np.concatenate([*self.start, np.zeros(len(self.start[0]))])
        held = self.DeclareDiscreteState(steady)
        smooth = int(self.DeclareDiscreteState(np.full(6, np.nan)))
        planned = self.DeclareAbstractState(Value[object](self._first_state()))

        def of(context: Context) -> Any:
            return context.get_abstract_state(int(planned)).get_value()

        def plan(context: Context, state: State) -> None:
            new = block._planned(of(context), context.get_discrete_state(smooth).value())
            new = replace(new, time=context.get_time())
            state.get_mutable_abstract_state(int(planned)).set_value(new)

        def sample(context: Context, values: DiscreteValues) -> None:
            now: Any = flight.Eval(context)
            before = context.get_discrete_state(smooth).value()
            if np.abs(now).max() > _MOST:
                now = np.full(6, np.nan)
            mixed = before + min(2 * period / knot, 1.0) * (now - before)
            values.set_value(smooth, mixed if np.isfinite(before).all() else now)
            since = context.get_time() - of(context).time
            if since >= 0:
                values.set_value(int(held), _sample(of(context).plan, since, period))

        self.DeclareStateOutputPort("reference", held)
        for name in ("computing_share", "is_kept"):

            def tell(context: Context, output: BasicVector, name: str = name) -> None:
                output.SetAtIndex(0, float(getattr(of(context), name)))

            self.DeclareVectorOutputPort(name, 1, tell, {self.abstract_state_ticket(planned)})
        self.DeclarePeriodicUnrestrictedUpdateEvent(knot, 0.0, plan)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, sample)

    def _idle(self, up: Array, seat: float) -> tuple[Array, Array]:
        """Return angles and speeds with `idle_g` along a unit vector at the head."""
        problem, n = self._problem, self._problem.robot.n
        goal = self.idle_g * up
        if self.idle_g == 1:
            return standing(problem, goal), np.zeros(n)
        arm = np.eye(n)[0] * problem.arm
        first = arm * self._spin[0] + np.eye(n)[-1] * seat
        x = nearer(problem, first[None], goal, self._spin, first=True)[0]
        q, v = x * (1 - arm), x * arm
        state = np.concatenate([q, v, 0 * q])
        force = problem.head_at(state)[:3] / GRAVITY
        if np.linalg.norm(force - goal) > _OFF or problem.excess(state[None])[0].max() > 0:
            raise InputError(
                f"{self.idle_g:g} G, expected a resultant that {problem.robot.name} can hold",
                place="idle_g",
            )
        return q, v

    def _first_state(self) -> _State:
        """Return the state one knot before the start, with a plan of steady motion and a stop."""
        problem, (q, v) = self._problem, self.start
        time = problem.knot * np.arange(-1, problem.count)[:, None]
        still = np.zeros((len(time), len(q)))
        plan = self._stopped(Trajectory(problem.knot, q + time * v, v + still, still))
        if plan is None:
            raise InputError("expected a resultant from which the device can stop", place="idle_g")
        head = problem.head_at(np.concatenate([q, v, 0 * q]))
        return _State(math.inf, plan, unfelt(head), head, None, _Washout(q + v, q + v, np.zeros(3)))

    def _planned(self, state: _State, head: Array) -> _State:
        """Return the state one knot later, for force and rate in flight at that time."""
        began, problem, state = clock.perf_counter(), self._problem, state.later
        h, model, plan = problem.knot, problem.model, state.plan
        before, after = problem.head_at(_states(plan)[:2])
        moved = advanced(model, state.on_device, before, after, h)
        state = replace(state, on_device=moved)
        if not np.isfinite(head).all():
            return replace(state, in_flight=None)
        flown = unfelt(head)
        if state.in_flight is not None:
            flown = advanced(model, state.in_flight, state.head, head, h)
        washout = self._washed(state.washout, head)
        lead = h * np.arange(1, problem.count + 1)[:, None]
        ahead = np.hstack([0 * lead + head[:3], np.exp(-lead / _FADE) * head[3:]])
        in_flight = followed(model, np.vstack([head, ahead]), h, flown)[1:]
        problem = replace(problem, head=ahead, felt=felt(model, in_flight, ahead), first=moved)
        if self._law == "washout":
            problem = replace(problem, angles=self._angles(plan, washout))
        found = solve(problem, _knots(plan, problem.count), lambda *_: None, _STEPS)
        if stopped := self._stopped(found):
            parts = zip(plan.parts, stopped.parts, strict=True)
            plan = _trajectory(h, (np.vstack([own[:1], new]) for own, new in parts))
        return replace(
            state, plan=plan, head=head, in_flight=flown, washout=washout, is_kept=stopped is None,
            computing_share=(clock.perf_counter() - began) / h,
        )  # fmt: skip

    def _stopped(self, plan: Trajectory) -> Trajectory | None:
        """Return a plan with the shortest stop behind it that keeps all limits; None if none does.

        All joints brake by the same share of their speeds.
        """
        problem, h = replace(self._problem, shift=0.0), plan.knot
        q, v = plan.q[-1], plan.v[-1]
        for duration in STOPS:
            shape = np.sin(np.pi * np.linspace(0, 1, round(duration / h) + 1)) ** 2
            a = np.outer(shape, -v / (h * shape.sum()))
            speed = v + h / 2 * np.cumsum(a[:-1] + a[1:], axis=0)
            speed[-1] = 0.0
            moves = h * np.vstack([v, speed[:-1]]) + h**2 * (a[:-1] / 3 + a[1:] / 6)
            stop = q + np.cumsum(moves, axis=0), speed, a[1:]
            parts = (np.vstack(x) for x in zip(plan.parts, stop, strict=True))
            stopped = _trajectory(h, parts)
            if problem.excess(_states(stopped.refined().refined().refined()))[0].max() <= 0:
                return stopped
        return None

    def _washed(self, washout: _Washout, head: Array) -> _Washout:
        """Return the washout after a time between knots."""
        h, x = self._problem.knot, washout.aligned[None]
        aligned = nearer(self._problem, x, head[:3] / GRAVITY, self._spin)[0]
        return _Washout(
            aligned,
            washout.tilt - math.expm1(-h / TILT) * (aligned - washout.tilt),
            washout.rate - math.expm1(-h / WASHOUT) * (head[3:] - washout.rate),
        )

    def _angles(self, plan: Trajectory, washout: _Washout) -> Array:
        """Return the angles of a washout at the knots of a new plan, shape (N, n)."""
        problem = self._problem
        x = turned(problem, washout.tilt[None], WASHOUT * washout.rate[None])
        angles = np.repeat(x, problem.count, axis=0)
        if problem.arm:
            angles[:, 0] = plan.q[1, 0] + problem.knot * np.arange(problem.count) * x[0, 0]
        return angles


def _trajectory(knot: float, parts: Iterable[Array]) -> Trajectory:
    q, v, a = parts
    return Trajectory(knot, q, v, a)


def _states(plan: Trajectory) -> Array:
    return np.hstack(plan.parts)


def _knots(plan: Trajectory, count: int) -> Trajectory:
    """Return the knots of a plan from the second one on, with rest behind its end."""
    i = np.minimum(np.arange(1, count + 1), len(plan.q) - 1)
    return _trajectory(plan.knot, (x[i] for x in plan.parts))


def _sample(plan: Trajectory, time: float, period: float) -> Array:
    """Return [q, v, vd] at a time within the first two knots; vd is the mean over a period."""
    q, v, a, j = plan.q[0], plan.v[0], plan.a[0], plan.jerk[0]
    mean = a + j * (time + period / 2)
    t = time
    return np.concatenate([q + v * t + a * t**2 / 2 + j * t**3 / 6, v + a * t + j * t**2 / 2, mean])
