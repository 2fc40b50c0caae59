"""The perception of orientation by a pilot: canals, otoliths, and the brain's internal model."""

from dataclasses import dataclass
from math import pi
from typing import Annotated

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike, NDArray
from pydantic import Field
from pydrake.systems import primitives
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from sdt_drake.io.fields import Input, NotNegative, Number, Positive, Text, Values, field
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.pilot.canals import ADAPTATION, CUPULA, canals
from sdt_drake.pilot.head import GRAVITY
from sdt_drake.systems.symbolic import Symbols, symbolic_law
from sdt_drake.systems.wiring import build, set_state

PERCEPTION = "perception model"
"""Kind of the files with perception models, a key of `sdt_drake.io.resources.SHIPPED`."""

_I, _0 = np.eye(3), np.zeros((3, 3))


@dataclass(frozen=True, kw_only=True)
class PerceptionModel(Input):
    """The gains and time constants of a pilot's sense of orientation.

    Lists have a value for each axis x, y, z of the head (roll, pitch, yaw).
    """

    source: Text
    """Publication of the numbers, and their origin."""
    k_w: Values[Positive] = field(min_length=3, max_length=3, unit="-")
    """Gain from the error of the canals (measured minus expected) to the felt rate."""
    k_fw: Values[NotNegative] = field(min_length=3, max_length=3, unit="1/s")
    """Gain from the tilt error to the felt rate."""
    k_fg: Values[NotNegative] = field(min_length=3, max_length=3, unit="1/s")
    """Gain from the tilt error to the felt gravity."""
    k_a: Values[Annotated[Number, Field(le=0)]] = field(min_length=3, max_length=3, unit="-")
    """Gain from the error of the otoliths (measured minus expected) to the felt acceleration."""
    tau: Values[Positive] = field((CUPULA,) * 3, min_length=3, max_length=3, unit="s")
    """Time constant of the cupula's return to rest."""
    tau_a: Values[Positive] = field((ADAPTATION,) * 3, min_length=3, max_length=3, unit="s")
    """Time constant of the adaptation of the canals' nerve."""
    cutoff: Number = field(2.0, gt=0, le=100, unit="Hz")
    """Cut-off frequency of all senses, and of the brain's expectation of them."""
    turn_gain: NotNegative = field(0.0, unit="-")
    """Felt bank over felt roll in a familiar turn, see `familiar_turn`; 0 for no such prior."""
    turn_time: Positive = field(66.0, unit="s")
    """Time constant in which the bank of a familiar turn fades."""


def load_perception(name: str) -> PerceptionModel:
    """Read a perception model.

    Args:
        name: YAML file, or the name of a shipped model.

    Raises:
        InputError: with a line for each problem.

    >>> load_perception("clark2019").tau
    (5.7, 5.7, 5.7)
    """
    return load_yaml(PerceptionModel, name, PERCEPTION)[0]


def orientation_observer(*, model: PerceptionModel) -> Diagram:
    """Make an observer of what a pilot in the dark feels (Merfeld 1993).

    In axes of the head, with f = -specific_force / g [G], LP = 1 / (s / omega_c + 1), and a hat for
    the estimates of the brain's internal model:

        y   = LP f                                                   otoliths
        y_w = tau s / (tau s + 1) tau_a s / (tau_a s + 1) LP omega   canals
        y^  = LP (g^ - a^),               a^ = k_a (y - y^)          felt acceleration [G]
        y^_w = tau s / (tau s + 1) LP w^r
        e   = rotation vector from y to y^                           tilt error [rad]
        w^r = k_fw e + k_w (y_w - y^_w),  w^ = (k_w + 1) / k_w w^r   felt rate [rad/s]
        dg^/dt = -(k_fg e + w^) x g^                                 felt gravity [G]

    Inputs: specific force [m/s²] of the head, +9.81 along z at rest, and angular rate [rad/s].
    Outputs: felt gravity [G], which points down, felt rate [rad/s] and felt acceleration [m/s²].
    The model has neither vision nor touch. It expects rest, and with `turn_gain` familiar turns.

    .. pydrake_system::

        name: orientation_observer
        input_ports: [specific_force, angular_rate]
        output_ports: [gravity, rate, acceleration]
    """
    builder = DiagramBuilder()
    lag = 2 * pi * model.cutoff
    force_to_y = primitives.LinearSystem(A=-lag * _I, B=-lag / GRAVITY * _I, C=_I, D=_0)
    otoliths = builder.AddNamedSystem("otoliths", force_to_y)
    low_pass = primitives.FirstOrderLowPassFilter(1 / lag, 3)
    filtered = builder.AddNamedSystem("low_pass", low_pass)
    senses = builder.AddNamedSystem("canals", canals(model.tau, model.tau_a))
    internal = builder.AddNamedSystem("internal_model", internal_model(model=model))
    builder.ExportInput(otoliths.get_input_port(), "specific_force")
    builder.ExportInput(filtered.get_input_port(), "angular_rate")
    builder.Connect(filtered.get_output_port(), senses.get_input_port())
    builder.Connect(otoliths.get_output_port(), internal.GetInputPort("otoliths"))
    builder.Connect(senses.get_output_port(), internal.GetInputPort("canals"))
    gravity = internal.GetOutputPort("gravity")
    if model.turn_gain:
        turn = builder.AddNamedSystem("familiar_turn", familiar_turn(model=model))
        for name in ("gravity", "rate"):
            builder.Connect(internal.GetOutputPort(name), turn.GetInputPort(name))
        gravity = turn.GetOutputPort("banked")
    builder.ExportOutput(gravity, "gravity")
    for name in ("rate", "acceleration"):
        builder.ExportOutput(internal.GetOutputPort(name), name)
    return build(builder, "orientation_observer")


def set_unfelt(
    observer: Diagram, context: Context, specific_force: ArrayLike, angular_rate: ArrayLike
) -> None:
    """Set the steady state at a specific force [m/s²] and an angular rate [rad/s].

    The force is then felt as gravity, and the rotation is not felt.
    """
    f, omega = -np.asarray(specific_force) / GRAVITY, np.asarray(angular_rate)
    set_state(observer, context, "otoliths", f)
    set_state(observer, context, "low_pass", omega)
    set_state(observer, context, "canals", np.concatenate([omega, np.zeros(3)]))
    set_state(observer, context, "internal_model/internal_otoliths", f)
    felt = np.concatenate([f / np.linalg.norm(f), np.zeros(6)])
    set_state(observer, context, "internal_model/felt/law", felt)


def familiar_turn(*, model: PerceptionModel) -> Diagram:
    """Make the prior of a familiar whole motion: a coordinated turn, flown forward.

    Rolls and turns to the same side belong to it, and are felt as a bank b beside the observer's:

        db/dt = turn_gain p max(0, -p r) / (|p r| + e²) - b / turn_time       e = 1 deg/s

    with p and r, the felt rates about x (roll to the right) and z (yaw to the left). The idea that
    motions are perceived as familiar wholes is of Holly, Vrublevskis & Carlson 2008 (J Vestib Res
    18:171); the equation is of this package.

    .. pydrake_system::

        name: familiar_turn
        input_ports: [gravity, rate]
        output_ports: [banked]
    """
    least = np.radians(1) ** 2

    def banked(x: Symbols, gravity: Symbols, rate: Symbols) -> Symbols:
        cosine, sine, (gx, gy, gz) = sym.cos(x[0]), sym.sin(x[0]), gravity
        return np.array([1 * gx, gy * cosine + gz * sine, gz * cosine - gy * sine])

    def rates(x: Symbols, gravity: Symbols, rate: Symbols) -> Symbols:
        product = rate[0] * rate[2]
        share = sym.max(sym.Expression(0), -product) / (sym.abs(product) + least)
        return np.array([model.turn_gain * share * rate[0] - x[0] / model.turn_time])

    return symbolic_law(
        inputs={"gravity": 3, "rate": 3}, output="banked", law=banked, rates=rates, states=1,
        name="familiar_turn",
    )  # fmt: skip


def internal_model(*, model: PerceptionModel) -> Diagram:
    """Make the brain's model of head and senses, corrected by the senses.

    The equations are in `orientation_observer`.

    .. pydrake_system::

        name: internal_model
        input_ports: [otoliths, canals]
        output_ports: [gravity, rate, acceleration]
    """
    lag, tau = 2 * pi * model.cutoff, np.array(model.tau)
    k_w, k_fw, k_fg, k_a = map(np.array, (model.k_w, model.k_fw, model.k_fg, model.k_a))
    K_a = np.diag(k_a)

    def tilt_error(otoliths: Symbols, expected: Symbols) -> Symbols:
        normal = _cross(otoliths, expected)
        # Without a branch: the error is 0 for parallel vectors, as their normal is 0.
        sine = sym.sqrt(normal @ normal + 1e-30)
        return normal * (sym.atan2(sine, otoliths @ expected) / sine)

    def felt(x: Symbols, error: Symbols, canals: Symbols) -> Symbols:
        gravity, low_pass, cupula = np.split(x, 3)
        w_r = k_fw * error + k_w * (canals - (low_pass - cupula))
        return np.concatenate([1 * gravity, (k_w + 1) / k_w * w_r])

    def rates(x: Symbols, error: Symbols, canals: Symbols) -> Symbols:
        gravity, low_pass, cupula = np.split(x, 3)
        rate = felt(x, error, canals)[3:]
        # The last term is 0 at |g^| = 1, and keeps g^ there.
        turning = _cross(gravity, k_fg * error + rate) + (1 - gravity @ gravity) * gravity
        w_r = k_w / (k_w + 1) * rate
        return np.concatenate([turning, lag * (w_r - low_pass), (low_pass - cupula) / tau])

    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect
    # y^' = omega_c (g^ - k_a (y - y^) - y^), inputs [g^, y].
    expected = add("internal_otoliths", primitives.LinearSystem(
        A=lag * (K_a - _I), B=lag * np.hstack([_I, -K_a]), C=_I, D=np.zeros((3, 6))
    ))  # fmt: skip
    error = add("tilt_error", symbolic_law(
        inputs={"otoliths": 3, "expected": 3}, output="error", law=tilt_error
    ))  # fmt: skip
    felt_law = add("felt", symbolic_law(
        inputs={"error": 3, "canals": 3}, output="felt", law=felt, rates=rates, states=9
    ))  # fmt: skip
    split = add("gravity_and_rate", primitives.Demultiplexer([3, 3]))
    model_inputs = add("gravity_and_otoliths", primitives.Multiplexer([3, 3]))
    differing = add("otoliths_and_expected", primitives.Multiplexer([3, 3]))
    acceleration = add("acceleration", primitives.MatrixGain(GRAVITY * np.hstack([K_a, -K_a])))

    otoliths = builder.ExportInput(error.GetInputPort("otoliths"), "otoliths")
    builder.ConnectInput(otoliths, model_inputs.get_input_port(1))
    builder.ConnectInput(otoliths, differing.get_input_port(0))
    builder.ExportInput(felt_law.GetInputPort("canals"), "canals")
    for port in (error.GetInputPort("expected"), differing.get_input_port(1)):
        connect(expected.get_output_port(), port)
    connect(error.get_output_port(), felt_law.GetInputPort("error"))
    connect(felt_law.get_output_port(), split.get_input_port())
    connect(split.get_output_port(0), model_inputs.get_input_port(0))
    connect(model_inputs.get_output_port(), expected.get_input_port())
    connect(differing.get_output_port(), acceleration.get_input_port())
    builder.ExportOutput(split.get_output_port(0), "gravity")
    builder.ExportOutput(split.get_output_port(1), "rate")
    builder.ExportOutput(acceleration.get_output_port(), "acceleration")
    return build(builder, "internal_model")


def _cross(a: NDArray[np.object_], b: NDArray[np.object_]) -> Symbols:
    """Return the vector product; `np.cross` accepts no symbols in some versions of numpy."""
    return np.roll(a, -1) * np.roll(b, -2) - np.roll(a, -2) * np.roll(b, -1)
