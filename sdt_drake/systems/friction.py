import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, System
from pydrake.systems.primitives import MatrixGain

from sdt_drake.io.arguments import positives
from sdt_drake.robot import device
from sdt_drake.systems.symbolic import Symbols, symbolic_law
from sdt_drake.systems.wiring import block_of, set_state

_UNIT = 100.0  # z / z_c per unit of the state; z / z_c is in the hundreds when sliding


def joint_friction(*, friction: device.FrictionParameters, gear_ratio: ArrayLike) -> Diagram:
    """Make Coulomb, viscous and Stribeck friction that can hold a joint at rest.

    Bristles of length z carry the Coulomb friction like a spring up to z_c, and slip beyond it.
    This elastic, perfectly plastic element neither creeps under a load below F_c nor drifts under
    an oscillating load, in contrast to the LuGre model:

        dz/dt = v - lambda (z - clip(z, -z_c, z_c))
        F     = F_c clip((z + T v) / z_c, -1, 1)
                + (F_b - F_c) (v / v_s) exp((1 - (v / v_s)²) / 2) + b v + F_0
        friction = F / r                                    [N m], motor side

    v, z and F are joint side. T v damps a sticking joint. In any motion |F - F_0| <= F_b + b |v|.
    Without F_0 energy only falls: the bristles store W = int F_c clip(z / z_c) dz, and
    (F - F_0) v - dW/dt is a sum of terms >= 0.

    In sliding, z is constant at z_c + v / lambda and F is `sliding_friction`. Under a load between
    F_c and F_b the joint creeps at less than v_s. State: z / z_c / 100 of the nested system "law".
    Purely viscous friction has no bristles and no state.

    Args:
        friction: parameters of n joints, joint side.
        gear_ratio: r [-], shape (n,), > 0.

    .. pydrake_system::

        name: joint_friction
        input_ports: [state]
        output_ports: [friction]
    """
    n = len(friction.coulomb)
    r = positives(gear_ratio, "gear_ratio", n)
    z_c = friction.presliding
    if not np.any([friction.coulomb, friction.breakaway, friction.offset]):
        gain = MatrixGain(np.hstack([np.zeros((n, n)), np.diag(friction.viscous / r)]))
        return block_of("joint_friction", gain, {"state": 2 * n}, "friction", "viscous")

    def within(stretch: sym.Expression) -> sym.Expression:
        return sym.min(sym.max(stretch, sym.Expression(-1)), sym.Expression(1))

    # Scaled for error control: as z [rad] the state would be too small, as z / z_c too large.
    def rates(x: Symbols, state: Symbols) -> list[sym.Expression]:
        stretch = _UNIT * x
        overflow = stretch - [within(u) for u in stretch]
        return list((state[n:] / z_c - device.OVERFLOW_RATE * overflow) / _UNIT)

    def law(x: Symbols, state: Symbols) -> list[sym.Expression]:
        v = state[n:]
        damped = _UNIT * x + device.PRESLIDING_DAMPING_TIME / z_c * v
        bristles = friction.coulomb * [within(u) for u in damped]
        return list((bristles + device.speed_friction(friction, v)) / r)

    return symbolic_law(
        inputs={"state": 2 * n},
        output="friction",
        law=law,
        rates=rates,
        states=n,
        name="joint_friction",
    )


def set_sliding(
    block: System, context: Context, v: ArrayLike, *, friction: device.FrictionParameters
) -> None:
    """Set bristles to steady sliding at v [rad/s], joint side; unloaded at v = 0."""
    if isinstance(block, Diagram) and block.HasSubsystemNamed("law"):
        set_state(block, context, "law", device.sliding_stretch(friction, v) / _UNIT)
