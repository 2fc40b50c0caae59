"""The limiter, the paper's off-line planner (Section 2): weak motors lag and catch up."""

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import work
from sdt_drake.motion import plan
from sdt_drake.motion.command import Command
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot

# Largest slip of an overpowered joint, away from its command:
_MAX_SLIP_SHARE = 0.01  # of the range of its commanded speeds [-], plus
_MAX_SLIP_SPEED = 1e-3  # rad/s
_MAX_SWEEPS = 1000
_MIN_LOOKAHEAD, _MAX_LOOKAHEAD = 16, 1024  # samples


def plan_motion(
    robot: Robot,
    command: Command,
    *,
    period: float = plan.INTERPOLATION_PERIOD,
    torque_margin: float = 1.0,
) -> plan.Plan:
    """Plan a motion in which a joint beyond its limits accelerates less and catches up later.

    Limits are those of the motors' torque and of acceleration. A motor that turns with two joints
    and is too weak holds back both. The limiter looks one period ahead, so coupling
    torques may overpower a motor before the speeds come down. A motion is refused in three cases:

    - A joint is driven away from its command with its motor at full torque, by more than 1 % of the
      range of its commanded speeds plus 1e-3 rad/s.
    - A joint is not back on its command at the end.
    - A motor that turns with two joints is too weak, and one of them would exceed its acceleration
      limit where the motor holds back the other.

    Args:
        robot: robot with its limits.
        command: commanded joint speeds.
        period: interpolation period [s].
        torque_margin: share of the motors' torque that may be used, in (0, 1].

    Raises:
        InputError: if the command does not fit the robot or the period; if the motion is refused,
            with joint, time, needed and available torque.

    >>> from sdt_drake.motion.command import load_command
    >>> from sdt_drake.robot.robot import load_robot
    >>> robot = load_robot()
    >>> plan = plan_motion(robot, load_command("graveyard_spin", robot))
    >>> plan.motion.duration, plan.limited.any().item()
    (85.0, False)
    """
    commanded = plan.commanded_motion(robot, command, period)
    plan.check_no_load_speed(robot, commanded)  # a joint held back there would never catch up
    v, limited = _limited_speeds(robot, commanded, torque_margin)
    motion = Motion.from_speeds(period, commanded.q[0], v)
    return plan.checked_plan(robot, motion, commanded, torque_margin, limited)


def _limited_speeds(
    robot: Robot, commanded: Motion, torque_margin: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the speeds nearest to the command, and where they are limited, (N + 1, n) each."""
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    period, command = commanded.period, commanded.v
    largest = robot.acceleration_limit + plan.ACCELERATION_TOLERANCE / 2
    guard = _LostMotionGuard(robot, commanded)
    to_joints = np.linalg.inv(robot.gear_coupling)  # speeds of gears to those of joints
    limited = np.zeros(command.shape, dtype=bool)
    speeds = command.copy()
    q, v = commanded.q[0], command[0]
    i, look, last = 0, _MIN_LOOKAHEAD, len(command) - 1
    with work() as report:
        while i < last:
            report(i / last)
            # Stretches without a limit are copied: much faster than period by period.
            if not limited[i - 1].any():
                ahead = slice(i, min(i + look, last))
                shifted = q + (commanded.q[ahead] - commanded.q[i])
                vd = commanded.vd[ahead]
                torque = robot.gear_torque(inverse_dynamics(robot, shifted, command[ahead], vd))
                low, high = robot.torque_range(command[ahead], torque_margin)
                off = (torque < low) | (torque > high) | (np.abs(vd) > largest)
                beyond = off.any(axis=1)
                followed = int(np.argmax(beyond)) if beyond.any() else beyond.size
                look = _MIN_LOOKAHEAD if beyond.any() else min(2 * look, _MAX_LOOKAHEAD)
                q = q + (commanded.q[i + followed] - commanded.q[i])
                i, v = i + followed, command[i + followed]
                if not beyond.any():
                    continue
            commanded_vd = (command[i + 1] - v) / period
            target = np.clip(commanded_vd, -largest, largest)
            plant.SetPositions(context, q)
            plant.SetVelocities(context, v)
            # At the outputs of the gears, where the limits are: each motor has one of its own.
            M = to_joints.T @ robot.mass_matrix(context) @ to_joints
            bias = to_joints.T @ (
                plant.CalcBiasTerm(context)
                + robot.damping * v
                - plant.CalcGravityGeneralizedForces(context)
            )
            available = robot.torque_range(v, torque_margin)
            wanted = robot.gear_speed(target)
            x = limit_accelerations(M, bias, wanted, *available)
            held = (to_joints[:, x != wanted] != 0).any(axis=1)
            vd = np.where(held, to_joints @ x, target)
            limited[i] = vd != commanded_vd
            v_next = np.where(limited[i], v + vd * period, command[i + 1])
            guard.check(i, wanted, x, M @ x + bias + M.diagonal() * (wanted - x), available)
            q = q + (v + v_next) * (period / 2)
            i, v = i + 1, v_next
            speeds[i] = v
    guard.check_end(v)
    return speeds, limited


def limit_accelerations(
    M: Array, bias: Array, target: Array, lowest: Array, highest: Array
) -> Array:
    """Return the accelerations nearest to `target` with lowest <= M vd + bias <= highest.

    All quantities belong to the outputs of the gears: to the joints, unless a motor turns with two.
    Each output reaches its target, or its motor is at its torque limit. The sweeps move one joint
    at a time, from tip to base, as close to its target as its limits allow. They stop when the set
    of motors at their limit is found; linear equations then give the accelerations. The sweeps are
    coordinate descent on

        1/2 (vd - target)' M (vd - target) + (M target + bias)' vd
            + highest' max(target - vd, 0) - lowest' max(vd - target, 0).

    M is positive definite, so this is strictly convex: there is one solution, and they reach it.

    Args:
        M: mass matrix with rotor inertia [kg m²], shape (n, n).
        bias: torques at zero acceleration [N m], shape (n,).
        target: accelerations [rad/s²], shape (n,).
        lowest, highest: available torques [N m], shape (n,).

    >>> M, limit = np.diag([2.0, 1.0]), np.array([3.0, 3.0])
    >>> limit_accelerations(M, np.zeros(2), np.array([5.0, 1.0]), -limit, limit)
    array([1.5, 1. ])
    """
    vd = target.copy()
    diagonal = M.diagonal()
    for _ in range(_MAX_SWEEPS):
        for k in reversed(range(len(vd))):
            rest = M[k] @ vd - diagonal[k] * vd[k] + bias[k]
            least, most = (lowest[k] - rest) / diagonal[k], (highest[k] - rest) / diagonal[k]
            vd[k] = min(max(target[k], least), most)
        solution = _with_motors_at_limit(M, bias, target, (lowest, highest), vd)
        if solution is not None:
            return solution
    raise InputError(f"accelerations within the torque limits not found in {_MAX_SWEEPS} sweeps")


def _with_motors_at_limit(
    M: Array, bias: Array, target: Array, available: tuple[Array, Array], estimate: Array
) -> Array | None:
    """Return the solution if the joints that miss their target in `estimate` are the right ones."""
    limited = estimate != target
    if not limited.any():
        return estimate
    short = np.sign(target - estimate)[limited]  # sign of the torque of a motor at its limit
    lowest, highest = available
    at_limit = np.where(short > 0, highest[limited], lowest[limited])
    vd = target.copy()
    rest = bias[limited] + M[np.ix_(limited, ~limited)] @ target[~limited]
    vd[limited] = np.linalg.solve(M[np.ix_(limited, limited)], at_limit - rest)
    torque = M @ vd + bias
    excess = np.maximum(lowest - torque, torque - highest)
    holds = np.all(excess <= plan.TORQUE_TOLERANCE / 2) and np.all(
        short * (target - vd)[limited] >= 0
    )
    return vd if holds else None


class _LostMotionGuard:
    """A check for overpowered joints.

    A limited joint lags and still accelerates towards its command. An overpowered joint is driven
    away from its command with its motor at full torque: it slips.
    """

    def __init__(self, robot: Robot, commanded: Motion) -> None:
        self._robot, self._commanded = robot, commanded
        range_ = np.ptp(robot.gear_speed(commanded.v), axis=0)
        self._max_slip = _MAX_SLIP_SHARE * range_ + _MAX_SLIP_SPEED
        self._slip = np.zeros(robot.n)
        self._onset = np.full(robot.n, -1)
        self._needed = np.zeros(robot.n)
        self._available = np.zeros((2, robot.n))

    def check(
        self, i: int, target: Array, vd: Array, torque: Array, available: tuple[Array, Array]
    ) -> None:
        """Refuse a joint that has slipped too far at the end of period i.

        Args:
            i: index of the period.
            target, vd: targeted and planned accelerations [rad/s²], shape (n,).
            torque: torque that a joint needs for its target while the others do `vd` [N m], (n,).
            available: lowest and highest torques [N m], shape (n,) each.
        """
        limited, period = vd != target, self._commanded.period
        start = limited & (self._onset < 0)
        self._onset[start] = i
        self._needed[start] = torque[start]
        self._available[:, start] = np.array(available)[:, start]
        self._onset[~limited] = -1
        away = limited & (vd * target <= 0)
        self._slip = np.where(limited, self._slip + away * np.abs(vd) * period, 0.0)
        k = int(np.argmax(self._slip / self._max_slip))
        if self._slip[k] > self._max_slip[k]:
            self._refuse(
                k,
                f"by {(i + 1) * period:.3f} s it is driven {self._slip[k]:.4g} rad/s away "
                f"from its command, allowed are {self._max_slip[k]:.4g} rad/s",
            )

    def check_end(self, v: Array) -> None:
        """Refuse a joint that is not back on its command at the end."""
        v, commanded = map(self._robot.gear_speed, (v, self._commanded.v[-1]))
        off = np.abs(v - commanded) > plan.SPEED_TOLERANCE
        if off.any():
            k = int(np.argmax(off))
            ends = f"ends at {v[k]:.4g} rad/s, commanded is {commanded[k]:.4g} rad/s"
            if self._onset[k] < 0:  # not limited by its torque
                most = self._robot.acceleration_limit[k]
                raise InputError(
                    f"motion refused: {self._robot.joint(k)} {ends}; its acceleration limit, "
                    f"{most:.6g} rad/s², is too low to catch up in time"
                )
            self._refuse(k, f"it {ends}")

    def _refuse(self, k: int, outcome: str) -> None:
        raise InputError(
            f"motion refused: {self._robot.joint(k)} at "
            f"{self._onset[k] * self._commanded.period:.3f} s needs torque "
            f"{self._needed[k]:.6g} N m, available {_range(*self._available[:, k])} N m; {outcome}"
        )


def _range(lowest: float, highest: float) -> str:
    """Return "±5", or "-5 to 3" if the limits differ."""
    return f"±{highest:.6g}" if highest == -lowest else f"{lowest:.6g} to {highest:.6g}"
