import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import MatrixGain, Multiplexer, ZeroOrderHold

from sdt_drake.io.arguments import finite_number, positive, positives, whole_number
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.systems.symbolic import Symbols, symbolic_law
from sdt_drake.systems.wiring import block_of, build, set_state


def encoder(
    *,
    n: int,
    period: float,
    resolution: ArrayLike | None = None,
    gear_ratio: ArrayLike | None = None,
    offset: float = 0.0,
) -> Diagram:
    """Make an encoder: samples the state [q, v], joint side, every period from `offset` on.

    With a resolution, the positions are those of an incremental encoder on the motor's shaft. The
    speeds are their differences, which lag by half a period:

        q_k = floor(q N r / (2 pi)) 2 pi / (N r),    v_k = (q_k - q_(k-1)) / period

    State: the last sample, of the nested system "now", or the last two, "now" and "before". The
    block does not delay: a sample is valid from its own instant on.

    Args:
        n: number of joints.
        period: sample period [s], > 0.
        resolution: N, increments per revolution of the motor [-], shape (n,); ideal by default.
        gear_ratio: r [-], shape (n,); required with a resolution.
        offset: time of the first sample [s]; 0 by default.

    .. pydrake_system::

        name: encoder
        input_ports: [state]
        output_ports: [measured]
    """
    whole_number(n, "n")
    positive(period, "period")
    finite_number(offset, "offset", minimum=0)
    if resolution is None:
        hold = ZeroOrderHold(period, 2 * n, offset)
        return block_of("encoder", hold, {"state": 2 * n}, "measured", "now")
    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect
    increment = _increment(resolution, gear_ratio, n)

    def count(state: Symbols) -> list[sym.Expression]:
        return [sym.floor(state[k] / step) * step for k, step in enumerate(increment)]

    one, zero = np.eye(n), np.zeros((n, n))
    difference = np.block([[one, zero], [one / period, -one / period]])
    counts = add("count", symbolic_law(inputs={"state": 2 * n}, output="q", law=count))
    # `before` is updated at the same instants, with the value that `now` held until then.
    now, before = (add(name, ZeroOrderHold(period, n, offset)) for name in ("now", "before"))
    samples = add("samples", Multiplexer([n, n]))
    measured = add("difference", MatrixGain(difference))
    builder.ExportInput(counts.get_input_port(), "state")
    connect(counts.get_output_port(), now.get_input_port())
    connect(now.get_output_port(), before.get_input_port())
    connect(now.get_output_port(), samples.get_input_port(0))
    connect(before.get_output_port(), samples.get_input_port(1))
    connect(samples.get_output_port(), measured.get_input_port())
    builder.ExportOutput(measured.get_output_port(), "measured")
    return build(builder, "encoder")


def set_measured(
    block: Diagram,
    context: Context,
    q: ArrayLike,
    v: ArrayLike,
    *,
    resolution: ArrayLike | None = None,
    gear_ratio: ArrayLike | None = None,
) -> None:
    """Set the samples of a steady motion through q [rad] at v [rad/s], joint side.

    Without an offset, a sample at time 0 follows. The last one before is then a period old.

    Resolution and gear ratio are those of the encoder.
    """
    q, v = np.asarray(q, dtype=float), np.asarray(v, dtype=float)
    if resolution is None:
        set_state(block, context, "now", np.concatenate([q, v]))
        return
    increment = _increment(resolution, gear_ratio, len(q))
    now = block.GetSubsystemByName("now")
    assert isinstance(now, ZeroOrderHold)
    turned = now.period() * v
    count = np.floor((q if now.offset() else q - turned) / increment) * increment
    set_state(block, context, "now", count)
    set_state(block, context, "before", count - turned)


def _increment(resolution: ArrayLike, gear_ratio: ArrayLike | None, n: int) -> Array:
    """Return the angle of a joint per increment of its encoder [rad], shape (n,)."""
    if gear_ratio is None:
        raise InputError("missing, required with a resolution", place="gear_ratio")
    shaft = positives(gear_ratio, "gear_ratio", n)
    return np.asarray(2 * np.pi / (positives(resolution, "resolution", n) * shaft))
