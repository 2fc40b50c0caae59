import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Diagram

from sdt_drake.io.arguments import positives
from sdt_drake.robot.stops import FULLY_DAMPED, RELEASE_SPEED, Stops
from sdt_drake.systems.symbolic import Symbols, symbolic_law


# Drake's own stops act in a discrete plant alone, as rigid ones without rebound: its solver has a
# fixed stiffness and damping. In the tamsi approximation the rebound depends on the time step.
def joint_stops(
    *, stops: Stops, lower: ArrayLike, upper: ArrayLike, gear_ratio: ArrayLike
) -> Diagram:
    """Make stops that push joints back, with the energy e² of what pressed them in.

        push = max(k x (1 - (1 - e²) clip(-w / 0.02, 0, 1)) + c w min(x / 1e-5, 1), 0)
        stop_torque = (push at upper - push at lower) / r           [N m], motor side

    x >= 0 is the angle beyond the stop [rad] and w = dx/dt [rad/s], joint side. A released spring
    has the share e² of its torque, so a joint leaves with e times its speed, to
    (0.02 rad/s / speed)². At rest the spring has its full stiffness k. A stop never pulls. No
    state.

    Args:
        stops: k, c and e; joint side.
        lower, upper: angles of the stops [rad], shape (n,); -inf and inf without.
        gear_ratio: r [-], shape (n,), > 0.

    .. pydrake_system::

        name: joint_stops
        input_ports: [state]
        output_ports: [stop_torque]
    """
    stiffness = np.array(stops.stiffness, dtype=float)
    n, lost = len(stiffness), 1 - stops.restitution**2
    damping = np.zeros(n) if stops.damping is None else np.array(stops.damping)
    ends = np.array([lower, upper], dtype=float)
    r = positives(gear_ratio, "gear_ratio", n)

    none = sym.Expression(0)

    def within(u: sym.Expression) -> sym.Expression:
        return sym.min(sym.max(u, none), sym.Expression(1))

    def push(k: int, beyond: sym.Expression, w: sym.Expression) -> sym.Expression:
        spring = stiffness[k] * beyond * (1 - lost * within(-w / RELEASE_SPEED))
        pressed = sym.max(spring + damping[k] * w * within(beyond / FULLY_DAMPED), none)
        return sym.if_then_else(beyond > 0, pressed, none)  # where both are 0, max has no slope

    def law(state: Symbols) -> list[sym.Expression]:
        torque = [none] * n
        for sign, stop in zip((-1, 1), ends, strict=True):
            for k in np.flatnonzero(np.isfinite(stop) & (stiffness > 0)).tolist():
                beyond, w = sign * (state[k] - stop[k]), sign * state[n + k]
                torque[k] = torque[k] + sign * push(k, beyond, w) / r[k]
        return torque

    return symbolic_law(inputs={"state": 2 * n}, output="stop_torque", law=law, name="joint_stops")
