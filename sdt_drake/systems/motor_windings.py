import pydrake.symbolic as sym
from pydrake.systems.framework import Context, Diagram, System

from sdt_drake.robot.windings import Windings
from sdt_drake.systems.symbolic import Symbols, symbolic_law
from sdt_drake.systems.wiring import set_state


def motor_windings(*, windings: Windings) -> Diagram:
    """Make the windings of motors, which copper losses warm (i²t).

        T_j dx_j/dt = (tau / tau_rated)² - x_j               for each part j: winding, housing
        winding_temperature = T_coolant + rise sum_j share_j x_j                        [°C]

    tau is motor side [N m]. Constant rated torque gives x_j = 1 in the end. The losses are those of
    the winding at its rated temperature: neither its resistance nor iron losses change. State: x of
    all parts, of the nested system "law".

    Args:
        windings: data of n motors.

    .. pydrake_system::

        name: motor_windings
        input_ports: [tau]
        output_ports: [winding_temperature]
    """
    m, n = windings.share.shape

    def rates(x: Symbols, tau: Symbols) -> list[sym.Expression]:
        heat = (tau / windings.rated_torque) ** 2
        return list(((heat - x.reshape(m, n)) / windings.time_constant).ravel())

    def law(x: Symbols, _tau: Symbols) -> list[sym.Expression]:
        return list(windings.temperature(x.reshape(m, n)))

    return symbolic_law(
        inputs={"tau": n},
        output="winding_temperature",
        law=law,
        rates=rates,
        states=m * n,
        name="motor_windings",
    )


def set_initial_temperature(block: System, context: Context, *, windings: Windings) -> None:
    """Set the windings to their temperature at the start."""
    set_state(block, context, "law", windings.start.ravel())
