import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Diagram

from sdt_drake.io.arguments import positives
from sdt_drake.io.arrays import Array
from sdt_drake.systems.symbolic import Symbols, symbolic_law

FULL_SPEED = 0.01
"""Speed of a joint from which on its gear loses its full share [rad/s]; less below, 0 at rest."""


def gear_loss(*, efficiency: ArrayLike) -> Diagram:
    """Make the losses of gears with an efficiency eta, a torque against the motion.

        gear_loss = |tau| clip(v / v_0, -1, 1) (1 - eta      if tau drives the joint, else
                                                1 / eta - 1)            [N m], motor side

    tau is the torque that goes through the gear. So a motor that drives gives eta of its power, and
    a joint that drives its motor, too. v_0 is `FULL_SPEED`.

    Args:
        efficiency: eta [-], shape (n,), 0 < eta <= 1.

    .. pydrake_system::

        name: gear_loss
        input_ports: [tau, state]
        output_ports: [gear_loss]
    """
    eta = positives(efficiency, "efficiency")
    n = len(eta)

    def law(tau: Symbols, state: Symbols) -> list[sym.Expression]:
        zero, one = sym.Expression(0.0), sym.Expression(1.0)
        share = [sym.min(sym.max(v / FULL_SPEED, -one), one) for v in state[n:]]
        lost = []
        for k in range(n):
            driving, driven = 1 - eta[k], 1 / eta[k] - 1
            ahead, back = sym.max(tau[k], zero), sym.max(-tau[k], zero)
            forwards = sym.max(share[k], zero) * (driving * ahead + driven * back)
            lost.append(forwards - sym.max(-share[k], zero) * (driving * back + driven * ahead))
        return lost

    inputs = {"tau": n, "state": 2 * n}
    return symbolic_law(inputs=inputs, output="gear_loss", law=law, name="gear_loss")


def driving_torque(efficiency: Array, load: Array, v: Array) -> Array:
    """Return the torque that turns joints against a load at steady speed, motor side [N m], (n,).

    Args:
        efficiency: eta [-], shape (n,).
        load: load without losses, motor side [N m], shape (n,).
        v: speed of the joints [rad/s], shape (n,).
    """
    share = np.minimum(np.abs(v) / FULL_SPEED, 1)
    lost = np.where(load * v > 0, (1 - efficiency) * share, (1 - 1 / efficiency) * share)
    return np.asarray(load / (1 - lost))
