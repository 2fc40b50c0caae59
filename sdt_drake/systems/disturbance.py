import pydrake.symbolic as sym
from pydrake.systems.framework import Diagram

from sdt_drake.io.arguments import finite_number, whole_number
from sdt_drake.systems.symbolic import TIME, Symbols, symbolic_law


def disturbance(*, n: int, amplitude: float, omega_d: float) -> Diagram:
    """Make a disturbance of the load torque that the controller's model lacks (Figure 6).

        disturbance = A sin(omega_D t) load_torque        [N m], motor side

    The disturbed load is tau_LD (1 + A sin(omega_D t)). The output is the disturbance alone.

    Args:
        n: number of joints.
        amplitude: A, share of the load torque [-], >= 0.
        omega_d: omega_D, frequency of the disturbance [rad/s], >= 0.

    .. pydrake_system::

        name: disturbance
        input_ports: [load_torque]
        output_ports: [disturbance]
    """
    whole_number(n, "n")
    finite_number(amplitude, "amplitude", minimum=0)
    finite_number(omega_d, "omega_d", minimum=0)

    def law(load_torque: Symbols) -> list[sym.Expression]:
        return [amplitude * sym.sin(omega_d * TIME) * tau for tau in load_torque]

    inputs = {"load_torque": n}
    return symbolic_law(
        inputs=inputs, output="disturbance", law=law, timed=True, name="disturbance"
    )
