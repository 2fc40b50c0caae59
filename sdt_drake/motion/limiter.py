"""The off-line planner of Section 2: commanded speeds to a motion within the motors' torques."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import work
from sdt_drake.motion.command import Command
from sdt_drake.motion.plan import (
    ACCELERATION_TOLERANCE,
    INTERPOLATION_PERIOD,
    SPEED_TOLERANCE,
    TORQUE_TOLERANCE,
    Plan,
    check_no_load_speed,
    checked_plan,
    commanded_motion,
)
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot

# What an overpowered joint may slip, while it is off its command, before the motion is lost:
_SLIP = 0.01  # of the range of its commanded speeds, and
_SLIP_SPEED = 1e-3  # rad/s
_MAX_SWEEPS = 1000
_SHORTEST_LOOK, _LONGEST_LOOK = 16, 1024  # samples


def plan_motion(
    robot: Robot,
    command: Command,
    *,
    period: float = INTERPOLATION_PERIOD,
    torque_margin: float = 1.0,
) -> Plan:
    """Plan a motion; where a motor is too weak, its joint accelerates less and catches up later.

    The same where the command asks for more than the acceleration limits of the robot.

    The limiter looks one period ahead. It can lose a motion for good, when coupling torques grow
    beyond a motor before the speeds come down. So a motion is refused if a joint is driven away
    from its command with its motor at full torque, by more than 1 % of the range of its commanded
    speeds and 1e-3 rad/s, even if it would come back; or if it is not on its command at the end.

    Args:
        robot: the robot.
        command: commanded joint speeds.
        period: interpolation period [s].
        torque_margin: share of the motors' torque that may be used, in (0, 1].

    Raises:
        InputError: if the command does not fit the robot or the period, or the motion cannot be
            done: naming joint, time, what it needs and what there is.
    """
    commanded = commanded_motion(robot, command, period)
    check_no_load_speed(robot, commanded)  # held back there, a joint would get lost
    v, limited = _limited_speeds(robot, commanded, torque_margin)
    motion = Motion.from_speeds(period, commanded.q[0], v)
    return checked_plan(robot, motion, commanded, torque_margin, limited)


def _limited_speeds(
    robot: Robot, commanded: Motion, torque_margin: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Speeds that follow the command, shape (N + 1, n), as closely as the torques allow."""
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    period, command = commanded.period, commanded.v
    largest = robot.acceleration_limit + ACCELERATION_TOLERANCE / 2
    guard = _LostMotionGuard(robot, commanded)
    limited = np.zeros(command.shape, dtype=bool)
    speeds = command.copy()
    q, v = commanded.q[0], command[0]
    i, look, last = 0, _SHORTEST_LOOK, len(command) - 1
    with work() as tell:
        while i < last:
            tell(i / last)
            # Most of a motion is its command. Following it is much faster than deciding on it.
            if not limited[i - 1].any():
                ahead = slice(i, min(i + look, last))
                shifted = q + (commanded.q[ahead] - commanded.q[i])
                vd = commanded.vd[ahead]
                torque = inverse_dynamics(robot, shifted, command[ahead], vd)
                low, high = robot.torque_range(command[ahead], torque_margin)
                off = (torque < low) | (torque > high) | (np.abs(vd) > largest)
                beyond = off.any(axis=1)
                followed = int(np.argmax(beyond)) if beyond.any() else beyond.size
                look = _SHORTEST_LOOK if beyond.any() else min(2 * look, _LONGEST_LOOK)
                q = q + (commanded.q[i + followed] - commanded.q[i])
                i, v = i + followed, command[i + followed]
                if not beyond.any():
                    continue
            wanted = (command[i + 1] - v) / period
            wish = np.clip(wanted, -largest, largest)
            plant.SetPositions(context, q)
            plant.SetVelocities(context, v)
            M = plant.CalcMassMatrix(context)  # with the motors' inertia
            bias = (
                plant.CalcBiasTerm(context)
                + robot.damping * v
                - plant.CalcGravityGeneralizedForces(context)
            )
            available = robot.torque_range(v, torque_margin)
            vd = limit_accelerations(M, bias, wish, *available)
            limited[i] = vd != wanted
            v_next = np.where(limited[i], v + vd * period, command[i + 1])
            guard.check(i, wish, vd, M @ vd + bias + M.diagonal() * (wish - vd), available)
            q = q + (v + v_next) * (period / 2)
            i, v = i + 1, v_next
            speeds[i] = v
    guard.check_end(v)
    return speeds, limited


def limit_accelerations(
    M: Array, bias: Array, wanted: Array, lowest: Array, highest: Array
) -> Array:
    """Accelerations [rad/s²] towards `wanted` with `lowest` <= M vd + bias <= `highest` [N m].

    Joint after joint from the tip to the base, each as near to its wish as the others leave it,
    until it is known which motors are at their limit; those joints' accelerations then follow
    from their torques. These sweeps are coordinate descent on

        1/2 (vd - wanted)' M (vd - wanted) + (M wanted + bias)' vd
            + highest' max(wanted - vd, 0) - lowest' max(vd - wanted, 0),

    which is strictly convex because M is positive definite: there is always one solution, in
    which each joint has its wish or its motor gives all it has, and the sweeps converge to it.
    """
    vd = wanted.copy()
    diagonal = M.diagonal()
    for _ in range(_MAX_SWEEPS):
        for k in reversed(range(len(vd))):
            rest = M[k] @ vd - diagonal[k] * vd[k] + bias[k]
            least, most = (lowest[k] - rest) / diagonal[k], (highest[k] - rest) / diagonal[k]
            vd[k] = min(max(wanted[k], least), most)
        solution = _with_motors_at_limit(M, bias, wanted, (lowest, highest), vd)
        if solution is not None:
            return solution
    raise InputError(f"accelerations within the torque limits not found in {_MAX_SWEEPS} sweeps")


def _with_motors_at_limit(
    M: Array, bias: Array, wanted: Array, available: tuple[Array, Array], estimate: Array
) -> Array | None:
    """The solution, if `estimate` shows rightly which joints cannot have their wish."""
    limited = estimate != wanted
    if not limited.any():
        return estimate
    short = np.sign(wanted - estimate)[limited]  # direction in which the motor gives all it has
    lowest, highest = available
    gives = np.where(short > 0, highest[limited], lowest[limited])
    vd = wanted.copy()
    rest = bias[limited] + M[np.ix_(limited, ~limited)] @ wanted[~limited]
    vd[limited] = np.linalg.solve(M[np.ix_(limited, limited)], gives - rest)
    torque = M @ vd + bias
    excess = np.maximum(lowest - torque, torque - highest)
    holds = np.all(excess <= TORQUE_TOLERANCE / 2) and np.all(short * (wanted - vd)[limited] >= 0)
    return vd if holds else None


class _LostMotionGuard:
    """Notices a joint that its motor can no longer hold to its command.

    A limited joint lags, but still accelerates towards its command. One that is driven away from
    it, with its motor at full torque, is overpowered; it slips.
    """

    def __init__(self, robot: Robot, commanded: Motion) -> None:
        self._robot, self._commanded = robot, commanded
        self._largest_slip = _SLIP * np.ptp(commanded.v, axis=0) + _SLIP_SPEED
        self._slip = np.zeros(robot.n)
        self._onset = np.full(robot.n, -1)
        self._needed = np.zeros(robot.n)
        self._available = np.zeros((2, robot.n))

    def check(
        self, i: int, wanted: Array, vd: Array, torque: Array, available: tuple[Array, Array]
    ) -> None:
        """Refuse a joint that has slipped too far by the end of period i.

        `wanted` and `vd` [rad/s²] are what each joint wishes and gets; `torque` [N m] is what it
        would need for its wish, beside what the others really do; `available` what there is.
        """
        limited, period = vd != wanted, self._commanded.period
        start = limited & (self._onset < 0)
        self._onset[start] = i
        self._needed[start] = torque[start]
        self._available[:, start] = np.array(available)[:, start]
        self._onset[~limited] = -1
        away = limited & (vd * wanted <= 0)
        self._slip = np.where(limited, self._slip + away * np.abs(vd) * period, 0.0)
        k = int(np.argmax(self._slip / self._largest_slip))
        if self._slip[k] > self._largest_slip[k]:
            self._refuse(
                k,
                f"by {(i + 1) * period:.3f} s it is driven {self._slip[k]:.4g} rad/s away "
                f"from its command, allowed are {self._largest_slip[k]:.4g} rad/s",
            )

    def check_end(self, v: Array) -> None:
        """Refuse a joint that is not back on its command at the end."""
        commanded = self._commanded.v[-1]
        off = np.abs(v - commanded) > SPEED_TOLERANCE
        if off.any():
            k = int(np.argmax(off))
            ends = f"ends at {v[k]:.4g} rad/s, commanded is {commanded[k]:.4g} rad/s"
            if self._onset[k] < 0:  # its motor gives what is wished
                most = self._robot.acceleration_limit[k]
                raise InputError(
                    f"motion refused: {self._robot.joint(k)} {ends}; its largest acceleration, "
                    f"{most:.6g} rad/s², does not bring it back in time"
                )
            self._refuse(k, f"it {ends}")

    def _refuse(self, k: int, outcome: str) -> None:
        raise InputError(
            f"motion refused: {self._robot.joint(k)} at "
            f"{self._onset[k] * self._commanded.period:.3f} s needs torque "
            f"{self._needed[k]:.6g} N m, available {_range(*self._available[:, k])} N m; {outcome}"
        )


def _range(lowest: float, highest: float) -> str:
    """For people: "±5", or "-5 to 3" where braking has more."""
    return f"±{highest:.6g}" if highest == -lowest else f"{lowest:.6g} to {highest:.6g}"
