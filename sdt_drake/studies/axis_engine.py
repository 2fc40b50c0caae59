"""Many variants of the decoupled axis loops at once, as arrays: what `make_axis_loop` does.

Each axis is on its own. With the motor speed w = r v, the integral part y of the controller's
torque, and everything of the reference held for a period (motor side, as everything below):

    I dw/dt = clip(tau, lower, upper) - L (1 + A sin(omega_D t)),     dy/dt = K_IS (w_ref - w)
    tau = y + K_PS (b w_ref - w) + tau_ff,        b = 1 for "pi", 0 for "p_in_feedback"

Between two changes of the clip this is linear, and solved in closed form: no step has an error of
integration. A period in which nothing saturates is one 2 x 2 map. Only the columns (a variant's
joint each) for which that is not sure are looked at more closely: the time at which tau crosses a
limit comes from the cubic through values and slopes of tau at both ends, and the solution goes on
from there. Being a little off with that time matters in second order only, since the clip is
continuous.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.tracking import constant_speed_segments
from sdt_drake.control import CONTROLLERS, feedforward_torque
from sdt_drake.design import Design
from sdt_drake.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.scenario import Scenario
from sdt_drake.simulate import Recording

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_BLOCK = 1024  # variants that go through the motion together: they fit into the cache
_FASTEST = 2.0  # rad per step: up to there the cubic is good to (1 rad)^4 / 384 of what tau moves
_LOOKS = 8  # points of the cubic at which a crossing is looked for
_SHORTEST = 1e-4  # of a step: between two crossings, so that there are not endlessly many
_SLOW = 1e-2  # rad of a disturbance
_TINY = 1e-150  # instead of a difference of eigenvalues that is 0


@dataclass(frozen=True, eq=False)
class AxisVariants:
    """V variants of the axis loops of n joints along one motion; all motor side.

    Tables are shared: variant i has `load_torque[load_of[i]]`, and feeds forward
    `feedforward_gain[i] * feedforward[feedforward_of[i]]`.

    Attributes:
        motion: shared, and its period.
        gear_ratio: r [-], shape (V, n).
        i_eff: inertia of the axis process [kg m²], shape (V, n).
        kp, ki: K_PS [N m s/rad] and K_IS [N m/rad], shape (V, n).
        on_error: whether K_PS acts on the speed error (structure "pi") or on the speed alone
            ("p_in_feedback"), shape (V,).
        torque_limit: of the motors [N m], shape (V, n).
        amplitude: A of the disturbance [-], shape (V,).
        omega_d: its frequency [rad/s], shape (V,).
        load_torque, alleviating_torque: by Algorithm 1 [N m], shape (T, N + 1, n).
        load_of: index of a variant's load tables, shape (V,).
        feedforward: torque tables [N m], shape (F, N + 1, n).
        feedforward_of: index of a variant's table, shape (V,).
        feedforward_gain: [-], shape (V, n).

    Raises:
        InputError: naming the attribute: for a wrong shape, numbers that are not finite, or not
            > 0 where they must be.
    """

    motion: Motion
    gear_ratio: Array
    i_eff: Array
    kp: Array
    ki: Array
    on_error: NDArray[np.bool_]
    torque_limit: Array
    amplitude: Array
    omega_d: Array
    load_torque: Array
    alleviating_torque: Array
    load_of: NDArray[np.intp]
    feedforward: Array
    feedforward_of: NDArray[np.intp]
    feedforward_gain: Array

    def __post_init__(self) -> None:
        count, n = len(self.i_eff), self.motion.n
        if count < 1:
            raise InputError("variants: none, expected at least one")
        tables = ("load_torque", "alleviating_torque", "feedforward")
        one_each = ("on_error", "amplitude", "omega_d", "load_of", "feedforward_of")
        positive = ("gear_ratio", "i_eff", "kp", "ki", "torque_limit")
        for field in fields(self)[1:]:
            values = getattr(self, field.name)
            shape = (count,) if field.name in one_each else (count, n)
            if field.name in tables:
                shape = (len(values), *self.motion.v.shape)
            if np.shape(values) != shape:
                raise InputError(f"{field.name}: shape {np.shape(values)}, expected {shape}")
            if not np.all(np.isfinite(values)):
                raise InputError(f"{field.name}: contains a value that is not finite")
            if field.name in positive and np.any(values <= 0):
                raise InputError(f"{field.name}: {values.min():g}, every value must be > 0")
            if field.name in one_each and np.any(values < 0):
                raise InputError(f"{field.name}: {values.min():g}, every value must be >= 0")
        for index, tables_of in (("load_of", "load_torque"), ("feedforward_of", "feedforward")):
            most, there = int(getattr(self, index).max()), len(getattr(self, tables_of))
            if most >= there:
                raise InputError(f"{index}: {most}, but {tables_of} has {there} table(s)")
        if len(self.alleviating_torque) != len(self.load_torque):
            raise InputError("alleviating_torque: expected as many tables as load_torque has")

    def __len__(self) -> int:
        return len(self.i_eff)


@dataclass(frozen=True, eq=False)
class AxisOutcomes:
    """What came out, as analysis/tracking.py defines it; each of shape (V, n).

    Attributes:
        max_abs_speed_error, rms_speed_error: joint side [rad/s].
        constant_speed_error: joint side [rad/s]; NaN for a joint without such a segment.
        saturated_fraction: share of samples at which the motor gives less than was asked [-].
        max_abs_position_error: joint side [rad].
        peak_torque, rms_torque: of the motors, motor side [N m].
        recordings: of each variant, where they were asked for.
    """

    max_abs_speed_error: Array
    rms_speed_error: Array
    constant_speed_error: Array
    saturated_fraction: Array
    max_abs_position_error: Array
    peak_torque: Array
    rms_torque: Array
    recordings: tuple[Recording, ...] | None = None


METRICS = tuple(field.name for field in fields(AxisOutcomes) if field.name != "recordings")


def only_in_drake(scenario: Scenario) -> str | None:
    """The field of a scenario that only the Drake loop does; None if the axis engine does all."""
    plant, controller = scenario.plant, scenario.controller
    for field, differs in (
        (f"plant.kind: {plant.kind}", plant.kind != "axis"),
        ("plant.friction", plant.friction is not None),
        ("plant.elasticity", plant.elasticity is not None),
        ("drive", scenario.drive is not None),
        (
            f"controller.kind: {controller.kind}",
            CONTROLLERS[controller.kind].feedback != "speed",
        ),
        ("controller.anti_windup", controller.anti_windup),
    ):
        if differs:
            return field
    return None


def variants_of(designs: Iterable[Design]) -> AxisVariants:
    """The axis loops of designs that share one motion.

    Raises:
        InputError: for no design, another motion than that of the first, or what only Drake does.
    """
    batch = AxisBatch()
    for design in designs:
        batch.add(design)
    return batch.variants()


class AxisBatch:
    """Collects designs that share one motion; keeps of each only what is its own."""

    def __init__(self) -> None:
        self._motion: Motion | None = None
        self._loads, self._feedforwards = _Tables(), _Tables()
        self._own: list[dict] = []

    def add(self, design: Design) -> None:
        """One more.

        Raises:
            InputError: for another motion than that of the first, or what only Drake does.
        """
        scenario, robot, gains = design.scenario, design.robot, design.gains
        if field := only_in_drake(scenario):
            name = f"scenario '{scenario.name}': " if scenario.name else ""
            raise InputError(f"{name}{field} runs in Drake only, not in the axis engine")
        self._motion = self._motion or design.motion
        if not _same_motion(design.motion, self._motion):
            raise InputError(
                f"scenario '{scenario.name}': another motion or period than the first "
                "variant's; variants share both"
            )
        feedforward, gain = _feedforward(design)
        self._own.append(
            {
                "gear_ratio": robot.gear_ratio,
                "i_eff": design.i_eff,
                "kp": gains.kp,
                "ki": gains.ki,
                "on_error": scenario.controller.structure_in_use == "pi",
                "torque_limit": robot.motor_torque_limit,
                "amplitude": float(scenario.disturbance.amplitude),
                "omega_d": float(scenario.disturbance.omega_d),
                "load_of": self._loads.index(np.stack(design.loads)),
                "feedforward_of": self._feedforwards.index(feedforward),
                "feedforward_gain": gain,
            }
        )

    def variants(self) -> AxisVariants:
        """All that were added.

        Raises:
            InputError: if there are none.
        """
        if self._motion is None:
            raise InputError("variants: none, expected at least one design")
        load_torque, alleviating_torque = np.swapaxes(np.array(self._loads.tables), 0, 1)
        return AxisVariants(
            motion=self._motion,
            load_torque=load_torque,
            alleviating_torque=alleviating_torque,
            feedforward=np.array(self._feedforwards.tables),
            **{name: np.array([own[name] for own in self._own]) for name in self._own[0]},
        )


class _Tables:
    """Tables, each kept once."""

    def __init__(self) -> None:
        self.tables: list[Array] = []
        self._index: dict[bytes, int] = {}

    def index(self, table: Array) -> int:
        key = hashlib.sha256(np.ascontiguousarray(table)).digest()
        if key not in self._index:
            self._index[key] = len(self.tables)
            self.tables.append(table)
        return self._index[key]


def _same_motion(motion: Motion, other: Motion) -> bool:
    if motion is other:
        return True
    return motion.period == other.period and all(
        np.array_equal(getattr(motion, name), getattr(other, name)) for name in ("q", "v", "vd")
    )


def _feedforward(design: Design) -> tuple[Array, Array]:
    """Table and gain; the gain on its own where variants then can share the table."""
    n, choice = design.robot.n, design.scenario.controller
    if design.tau_ff is None:
        return np.zeros_like(design.motion.v), np.ones(n)
    if choice.feedforward_gain is None or design.model is not design.robot:
        return design.tau_ff, np.ones(n)
    kind, sign, torques = choice.feedforward_in_use, design.scenario.algorithm, design.torques
    groups = (torques.inertial, torques.reaction, torques.velocity, torques.gravity)
    table = feedforward_torque(kind, design.robot, groups, design.motion.vd, sign)
    return table, np.array(choice.feedforward_gain)


def simulate_axes(variants: AxisVariants, *, record: bool = False) -> AxisOutcomes:
    """Run all variants along their motion, starting on the reference as `simulate` does.

    The result of a variant does not depend on the others. Memory is that of one block of variants,
    however long the motion, unless recordings are asked for.
    """
    count, n = variants.i_eff.shape
    metrics = {name: np.empty((count, n)) for name in METRICS}
    recordings: list[Recording | None] = [None] * count
    for which, steps in _blocks(variants):
        run = _Run(variants, which, steps, record)
        for name, values in run.metrics().items():
            metrics[name][which] = values
        for i, recording in zip(which, run.recordings(), strict=False):
            recordings[i] = recording
    return AxisOutcomes(**metrics, recordings=tuple(recordings) if record else None)


def _blocks(variants: AxisVariants) -> Iterator[tuple[NDArray[np.intp], int]]:
    """Variants that go together, and how many steps they need for a period."""
    poles = np.maximum(variants.kp / variants.i_eff, np.sqrt(variants.ki / variants.i_eff))
    disturbed = np.where(variants.amplitude > 0, variants.omega_d, 0.0)
    angle = np.maximum(poles.max(axis=1), disturbed) * variants.motion.period
    steps = 2 ** np.ceil(np.log2(np.maximum(angle / _FASTEST, 1.0))).astype(int)
    for needed in np.unique(steps):
        same = np.flatnonzero(steps == needed)
        for start in range(0, len(same), _BLOCK):
            yield same[start : start + _BLOCK], int(needed)


class _Loop(NamedTuple):
    """Constants of columns, each of shape (M,)."""

    inertia: Array
    kp: Array
    ki: Array
    amplitude: Array
    omega: Array
    decay: Array  # mean of the two eigenvalues
    spread: Complex  # half their difference
    response: Complex  # of y to A sin(omega_D t) per load torque, as a phasor

    @staticmethod
    def of(inertia: Array, kp: Array, ki: Array, amplitude: Array, omega: Array) -> _Loop:
        decay = -kp / (2 * inertia)
        spread = np.sqrt(decay**2 - ki / inertia + 0j)
        spread = np.where(np.abs(spread) < _TINY, _TINY, spread)
        response = amplitude * ki / (ki - inertia * omega**2 + 1j * omega * kp)
        return _Loop(inertia, kp, ki, amplitude, omega, decay, spread, response)

    def take(self, at: NDArray[np.intp]) -> _Loop:
        return _Loop(*(values[at] for values in self))

    def free(self, d: Array | float) -> tuple[Array, Array, Array, Array]:
        """exp(A d) of A = [[-K_PS / I, 1 / I], [-K_IS, 0]], by rows."""
        slow = np.exp((self.decay + self.spread) * d)
        sine = -slow * np.expm1(-2 * self.spread * d) / (2 * self.spread)
        cosine, sine = (slow - self.spread * sine).real, sine.real
        return (
            cosine + self.decay * sine,
            sine / self.inertia,
            -self.ki * sine,
            cosine - self.decay * sine,
        )

    def forced(self, phasor: Complex) -> tuple[Array, Array]:
        """What w and y do in the end under A sin(omega_D t), per load torque."""
        y = self.response * phasor
        return -self.omega / self.ki * y.real, y.imag


class _Held(NamedTuple):
    """What is constant for a period, each of shape (M,)."""

    w_ref: Array
    load: Array
    lower: Array
    upper: Array
    base: Array  # tau = y - K_PS w + base

    def take(self, at: NDArray[np.intp]) -> _Held:
        return _Held(*(values[at] for values in self))


def _unsaturated(
    loop: _Loop, held: _Held, w: Array, y: Array, d: Array, phasor: Complex, turn: Complex
) -> tuple[Array, Array]:
    """w and y after d, where nothing limits tau; phasor exp(i omega_D t), turn exp(i omega_D d)."""
    w0, y0 = loop.forced(phasor)
    w1, y1 = loop.forced(phasor * turn)
    rest = held.load + loop.kp * held.w_ref - held.base  # y that holds w_ref against the load
    e, x = w - held.w_ref - held.load * w0, y - rest - held.load * y0
    ee, ex, xe, xx = loop.free(d)
    return ee * e + ex * x + held.w_ref + held.load * w1, xe * e + xx * x + rest + held.load * y1


def _sine_integrals(omega: Array, d: Array | float, turn: Complex) -> tuple[Complex, Complex]:
    """First and second integral of exp(i omega t) from 0 to d; turn = exp(i omega d)."""
    i, x = 1j * omega, 1j * omega * d
    slow = np.abs(x) < _SLOW  # where the closed form cancels
    divisor = np.where(slow, 1.0, i)
    series = 1 + x / 3 * (1 + x / 4 * (1 + x / 5 * (1 + x / 6)))  # of twice, by d^2 / 2
    once = np.where(slow, d * (1 + x / 2 * series), (turn - 1) / divisor)
    return once, np.where(slow, d * d / 2 * series, (once - d) / divisor)


def _saturated(
    loop: _Loop,
    held: _Held,
    tau: Array,
    w: Array,
    y: Array,
    d: Array | float,
    phasor: Complex,
    integrals: tuple[Complex, Complex],
) -> tuple[Array, Array]:
    """w and y after d, where the motor gives `tau` all the time."""
    once, twice = ((phasor * integral).imag for integral in integrals)
    excess, shaken = (tau - held.load) / loop.inertia, held.load * loop.amplitude / loop.inertia
    angle = w * d + excess * (d * d / 2) - shaken * twice
    return w + excess * d - shaken * once, y + loop.ki * (held.w_ref * d - angle)


class _Cubic(NamedTuple):
    """tau over a step: value and slope times length at both ends, each of shape (M,)."""

    tau0: Array
    move0: Array
    tau1: Array
    move1: Array

    def __call__(self, s: Array) -> Array:
        """tau at the share s of the step."""
        return self.tau0 + s * (
            self.move0
            + s
            * (
                3 * (self.tau1 - self.tau0)
                - 2 * self.move0
                - self.move1
                + s * (2 * (self.tau0 - self.tau1) + self.move0 + self.move1)
            )
        )

    def take(self, at: NDArray[np.intp]) -> _Cubic:
        return _Cubic(*(values[at] for values in self))

    def hull(self) -> tuple[Array, Array]:
        """What it stays between over the step: the extremes of its Bezier points."""
        beside0, beside1 = self.tau0 + self.move0 / 3, self.tau1 - self.move1 / 3
        return (
            np.minimum(np.minimum(self.tau0, beside0), np.minimum(self.tau1, beside1)),
            np.maximum(np.maximum(self.tau0, beside0), np.maximum(self.tau1, beside1)),
        )

    def slope(self, s: Array) -> Array:
        a, b = self.tau1 - self.tau0, self.move0 + self.move1
        return self.move0 + s * (2 * (3 * a - b - self.move0) + s * 3 * (b - 2 * a))


class _Crossings(NamedTuple):
    """Where tau first leaves a mode in a step; only of the columns in which it does."""

    column: NDArray[np.intp]  # that has one
    share: Array  # of the step
    mode: NDArray[np.intp]  # from then on


def _outside(held: _Held, tau: Array) -> NDArray[np.intp]:
    """1 above the upper limit, -1 below the lower, 0 between: the mode that tau asks for."""
    return (tau > held.upper).astype(int) - (tau < held.lower)


def _limit(held: _Held, mode: NDArray[np.intp]) -> Array:
    return np.where(mode > 0, held.upper, held.lower)


def _cubic(
    loop: _Loop,
    held: _Held,
    mode: NDArray[np.intp],
    ends: Sequence[tuple[Array, Array, Complex]],
    d: Array | float,
) -> _Cubic:
    """tau over a step in one mode, from w, y and phasor at its ends."""
    parts = []
    for w, y, phasor in ends:
        tau = y - loop.kp * w + held.base
        given = np.where(mode == 0, tau, _limit(held, mode))
        load = held.load * (1 + loop.amplitude * phasor.imag)
        slope = loop.ki * (held.w_ref - w) - loop.kp / loop.inertia * (given - load)
        parts += [tau, slope * d]
    return _Cubic(*parts)


_SHARES = np.arange(1, _LOOKS + 1)[:, np.newaxis] / _LOOKS


def _crossings(held: _Held, mode: NDArray[np.intp], cubic: _Cubic) -> _Crossings:
    asked = _outside(held, cubic(_SHARES))
    left = asked != mode
    column = np.flatnonzero(left.any(axis=0))
    held, mode, cubic = held.take(column), mode[column], cubic.take(column)
    first = left[:, column].argmax(axis=0)
    following = np.where(mode == 0, asked[first, column], 0)
    limit = _limit(held, np.where(mode == 0, following, mode))
    start, end = first / _LOOKS, (first + 1) / _LOOKS
    share = 0.5 * (start + end)
    for _ in range(3):  # Newton, kept where the crossing is
        slope = cubic.slope(share)
        slope = np.where(slope == 0, np.inf, slope)
        share = np.minimum(np.maximum(share - (cubic(share) - limit) / slope, start), end)
    return _Crossings(column, share, following)


def _advance(
    loop: _Loop,
    held: _Held,
    mode: NDArray[np.intp],
    w: Array,
    y: Array,
    d: Array,
    phasor: Complex,
) -> tuple[Array, Array, Complex]:
    """w, y and phasor after d in one mode."""
    turn = np.exp(1j * loop.omega * d)
    w0, y0 = _unsaturated(loop, held, w, y, d, phasor, turn)
    integrals = _sine_integrals(loop.omega, d, turn)
    w1, y1 = _saturated(loop, held, _limit(held, mode), w, y, d, phasor, integrals)
    return np.where(mode == 0, w0, w1), np.where(mode == 0, y0, y1), phasor * turn


def _follow(
    loop: _Loop,
    held: _Held,
    mode: NDArray[np.intp],
    w: Array,
    y: Array,
    step: float,
    phasor: Complex,
    crossings: _Crossings,
) -> tuple[Array, Array]:
    """w and y after a step of columns that all have a crossing, from one to the next."""
    w_end, y_end = np.empty_like(w), np.empty_like(y)
    column, rest = np.arange(len(w)), np.full(len(w), step)
    while len(column):
        d = np.minimum(np.maximum(crossings.share * rest, _SHORTEST * step), rest)
        w, y, phasor = _advance(loop, held, mode, w, y, d, phasor)
        rest, mode = rest - d, crossings.mode
        w1, y1, phasor1 = _advance(loop, held, mode, w, y, rest, phasor)
        w_end[column], y_end[column] = w1, y1
        on = np.flatnonzero(rest > _SHORTEST * step)
        cubic = _cubic(loop, held, mode, ((w, y, phasor), (w1, y1, phasor1)), rest)
        crossings = _crossings(held.take(on), mode[on], cubic.take(on))
        on = on[crossings.column]
        loop, held = loop.take(on), held.take(on)
        column, rest, mode, w, y, phasor = (a[on] for a in (column, rest, mode, w, y, phasor))
    return w_end, y_end


class _Run:
    """Variants of a block along the motion; columns are joint by joint: (n, V) made flat."""

    def __init__(
        self, variants: AxisVariants, which: NDArray[np.intp], steps: int, record: bool
    ) -> None:
        self._variants, self._which, motion = variants, which, variants.motion
        self._period, self._step = motion.period, motion.period / steps
        self._ratio = self._columns(variants.gear_ratio)
        self._limit = self._columns(variants.torque_limit)
        self._gain = self._columns(variants.feedforward_gain)
        self._on_error = self._columns(variants.on_error[:, np.newaxis])
        self._loop = loop = _Loop.of(
            self._columns(variants.i_eff),
            self._columns(variants.kp),
            self._columns(variants.ki),
            self._columns(variants.amplitude[:, np.newaxis]),
            self._columns(variants.omega_d[:, np.newaxis]),
        )
        self._map = loop.free(self._step)
        self._turn = np.exp(1j * loop.omega * self._step)
        self._integrals = _sine_integrals(loop.omega, self._step, self._turn)
        self._phasor = np.ones(len(self._turn), dtype=complex)
        self._forced = loop.forced(self._phasor)
        # Of -tau in a third of a step, left to itself, per tau and w:
        third = self._step / 3
        self._fall = loop.kp / loop.inertia * third, loop.ki * third
        # Of tau, under the disturbance, per load torque:
        self._swing = np.abs(loop.response) * np.hypot(1, loop.kp * loop.omega / loop.ki)
        self._w = self._ratio * self._rows(motion.v[0])
        # What -K_PS v takes away at the start, the integral gives.
        self._y = self._start = np.where(self._on_error, 0.0, loop.kp * self._w)
        self._totals = _Totals.of(len(self._w))
        # Angle by the held speeds alone, off the reference's; (N + 1, n)
        held_angle = np.vstack([0 * motion.v[:1], np.cumsum(motion.v[:-1], axis=0)])
        self._drift = motion.q[0] + motion.period * held_angle - motion.q
        self._settled = constant_speed_segments(motion)
        self._recorded: list[tuple[Array, ...]] | None = [] if record else None
        self._go(steps)

    def _go(self, steps: int) -> None:
        held = self._held(0)
        self._tally(0, held)
        for i in range(len(self._variants.motion.v) - 1):
            held = self._held(i)
            _, start = self._torque(held)
            for _ in range(steps):
                self._advance(held)
            self._tally_torque(start, self._tally(i + 1, held))

    def _torque(self, held: _Held) -> tuple[Array, Array]:
        """What the controllers ask for now, and what the motors give."""
        tau_cmd = self._y - self._loop.kp * self._w + held.base
        return tau_cmd, np.minimum(np.maximum(tau_cmd, held.lower), held.upper)

    def _columns(self, values: Array) -> Array:
        """(V, n) or (V, 1), to columns."""
        count, n = len(self._which), self._variants.motion.n
        return np.broadcast_to(values[self._which].T, (n, count)).ravel()

    def _rows(self, values: Array) -> Array:
        """(n,), to columns."""
        return np.repeat(values, len(self._which))

    def _looked_up(self, tables: Array, index: NDArray[np.intp], i: int) -> Array:
        """Sample i of each variant's table, to columns."""
        return tables[:, i].T.take(index[self._which], axis=1).ravel()

    def _held(self, i: int) -> _Held:
        """What sample i of the reference holds for a period."""
        variants, loop = self._variants, self._loop
        help_ = self._looked_up(variants.alleviating_torque, variants.load_of, i)
        tau_ff = self._gain * self._looked_up(variants.feedforward, variants.feedforward_of, i)
        w_ref = self._ratio * self._rows(variants.motion.v[i])
        return _Held(
            w_ref=w_ref,
            load=self._looked_up(variants.load_torque, variants.load_of, i),
            lower=np.minimum(help_, 0.0) - self._limit,
            upper=np.maximum(help_, 0.0) + self._limit,
            base=self._on_error * loop.kp * w_ref + tau_ff,
        )

    def _advance(self, held: _Held) -> None:
        """One step: the linear map for all, then again for those near their limits."""
        loop, (w0, y0), (ee, ex, xe, xx) = self._loop, self._forced, self._map
        phasor = self._phasor * self._turn
        w1, y1 = forced = loop.forced(phasor)
        rest = held.load + loop.kp * held.w_ref - held.base
        e, x = self._w - held.w_ref - held.load * w0, self._y - rest - held.load * y0
        e1, x1 = ee * e + ex * x, xe * e + xx * x
        w, y = e1 + held.w_ref + held.load * w1, x1 + rest + held.load * y1

        near = np.flatnonzero(self._near_limit(held, (e, x), (e1, x1)))
        if len(near):
            w[near], y[near] = self._closely(near, held.take(near), w[near], y[near], phasor)
        self._w, self._y, self._phasor, self._forced = w, y, phasor, forced

    def _near_limit(self, held: _Held, *ends: tuple[Array, Array]) -> NDArray[np.bool_]:
        """Whether tau may pass a limit: its cubic stays between the points that make it up."""
        (e0, x0), (e1, x1) = ends
        (of_tau, of_w), kp = self._fall, self._loop.kp
        tau0, tau1 = x0 - kp * e0, x1 - kp * e1
        beside0, beside1 = tau0 - of_tau * tau0 - of_w * e0, tau1 + of_tau * tau1 + of_w * e1
        lowest = np.minimum(np.minimum(tau0, beside0), np.minimum(tau1, beside1))
        highest = np.maximum(np.maximum(tau0, beside0), np.maximum(tau1, beside1))
        swing = np.abs(held.load) * self._swing
        return (highest > held.upper - held.load - swing) | (
            lowest < held.lower - held.load + swing
        )

    def _closely(
        self, at: NDArray[np.intp], held: _Held, w1: Array, y1: Array, phasor1: Complex
    ) -> tuple[Array, Array]:
        """w and y after a step of some columns, from those of the linear map."""
        loop, w, y = self._loop.take(at), self._w[at], self._y[at]
        phasor = self._phasor[at]
        mode = _outside(held, y - loop.kp * w + held.base)
        integrals = self._integrals[0][at], self._integrals[1][at]
        limit = _limit(held, mode)
        ws, ys = _saturated(loop, held, limit, w, y, self._step, phasor, integrals)
        w1, y1 = np.where(mode == 0, w1, ws), np.where(mode == 0, y1, ys)
        ends = ((w, y, phasor), (w1, y1, phasor1[at]))
        cubic = _cubic(loop, held, mode, ends, self._step)
        lowest, highest = cubic.hull()
        stays = np.where(mode < 1, highest <= held.upper, lowest > held.upper)
        stays &= np.where(mode > -1, lowest >= held.lower, highest < held.lower)
        on = np.flatnonzero(~stays)
        if len(on):
            crossings = _crossings(held.take(on), mode[on], cubic.take(on))
            on = on[crossings.column]
            w1[on], y1[on] = _follow(
                loop.take(on),
                held.take(on),
                mode[on],
                w[on],
                y[on],
                self._step,
                phasor[on],
                crossings,
            )
        return w1, y1

    def _tally_torque(self, start: Array, end: Array) -> None:
        """Count the torque of a period, linear between its ends (see tracking.PeriodTorque)."""
        totals = self._totals
        np.maximum(totals.torque, np.maximum(np.abs(start), np.abs(end)), out=totals.torque)
        totals.torque_squares[:] += (start * start + start * end + end * end) / 3

    def _tally(self, i: int, held: _Held) -> Array:
        """Count what a recording would have at sample i; its torque."""
        loop, motion, totals = self._loop, self._variants.motion, self._totals
        error = self._w / self._ratio - self._rows(motion.v[i])
        position_error = self._rows(self._drift[i]) - (self._y - self._start) / (
            loop.ki * self._ratio
        )
        tau_cmd, tau = self._torque(held)
        np.maximum(totals.speed, np.abs(error), out=totals.speed)
        np.maximum(totals.position, np.abs(position_error), out=totals.position)
        totals.speed_squares[:] += error * error
        totals.saturated[:] += tau != tau_cmd
        if self._settled[i].any():
            steady = np.where(self._rows(self._settled[i]), np.abs(error), -np.inf)
            np.maximum(totals.steady, steady, out=totals.steady)
        if self._recorded is not None:
            self._recorded.append(
                (
                    position_error + self._rows(motion.q[i]),
                    error + self._rows(motion.v[i]),
                    tau_cmd,
                    tau,
                    held.load,
                )
            )
        return tau

    def metrics(self) -> dict[str, Array]:
        """By their names in AxisOutcomes, each of shape (V, n)."""
        totals, samples = self._totals, len(self._variants.motion.v)
        values = {
            "max_abs_speed_error": totals.speed,
            "rms_speed_error": np.sqrt(totals.speed_squares / samples),
            "constant_speed_error": np.where(np.isinf(totals.steady), np.nan, totals.steady),
            "saturated_fraction": totals.saturated / samples,
            "max_abs_position_error": totals.position,
            "peak_torque": totals.torque,
            "rms_torque": np.sqrt(totals.torque_squares / (samples - 1)),
        }
        n = self._variants.motion.n
        return {name: column.reshape(n, -1).T for name, column in values.items()}

    def recordings(self) -> Iterator[Recording]:
        """Of each variant, none where they were not asked for."""
        if self._recorded is None:
            return
        motion, n = self._variants.motion, self._variants.motion.n
        # (signals, samples, n, V)
        signals = np.stack([np.stack(row) for row in self._recorded], axis=1)
        signals = signals.reshape(*signals.shape[:2], n, -1)
        for k in range(len(self._which)):
            q, v, tau_cmd, tau, load_torque = np.ascontiguousarray(signals[..., k])
            yield Recording(
                time=motion.time,
                q_ref=motion.q,
                v_ref=motion.v,
                q=q,
                v=v,
                tau_cmd=tau_cmd,
                tau_limited=tau,
                tau=tau,
                load_torque=load_torque,
            )


class _Totals(NamedTuple):
    """Largest magnitudes, sums of squares and counts so far, each of shape (M,)."""

    speed: Array
    steady: Array
    position: Array
    torque: Array
    speed_squares: Array
    torque_squares: Array
    saturated: Array

    @staticmethod
    def of(count: int) -> _Totals:
        totals = _Totals(*(np.zeros(count) for _ in _Totals._fields))
        totals.steady[:] = -np.inf
        return totals
