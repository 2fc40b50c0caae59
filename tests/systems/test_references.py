"""References, tables and holds, late or not; wiring by name, and logs."""

import numpy as np
import pytest
from alone import LOADS, MOTION, PERIOD, Alone, N, close, exact, made, outputs_of
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, ConstantVectorSource, Gain, PassThrough

from sdt_drake.io.errors import InputError
from sdt_drake.systems import connect_by_name, hold_of
from sdt_drake.systems.wiring import add_logs

ROWS = np.hstack([MOTION.q, MOTION.v, MOTION.vd])


def test_reference_source_is_exact_at_every_sample_and_linear_between():
    block = Alone("ReferenceSource")
    for i, row in enumerate(ROWS):
        block.context.SetTime(i * PERIOD)
        # The very last one is the end of a segment, with its round-off.
        (exact if i < len(ROWS) - 1 else close)(block.output("reference"), row)
    for i, share in [(0, 0.5), (7, 0.25), (2999, 0.9)]:
        block.context.SetTime((i + share) * PERIOD)
        expected = (1 - share) * ROWS[i] + share * ROWS[i + 1]
        np.testing.assert_allclose(block.output("reference"), expected, rtol=0, atol=1e-8)


SIGNALS = {**LOADS._asdict(), "inertia_share": MOTION.v}


def test_table_is_in_force_from_its_sample_on():
    block = Alone("SignalTable", signals=SIGNALS)
    assert list(outputs_of(block.system)) == list(SIGNALS)
    assert block.timing == (0, PERIOD)
    for i in range(len(MOTION.q) - 1):
        block.sample(time=i * PERIOD)
        for name, samples in SIGNALS.items():
            exact(block.output(name), samples[i])


# Offsets of the samples are what is left of the delay beyond whole periods.
DELAYS = pytest.mark.parametrize(
    ("delay", "offset"),
    [
        (0.0, 0.0),
        (PERIOD, 0.0),
        (3 * PERIOD, 0.0),
        (0.035, 0.0),  # 7 periods, but for the last bit
        (0.3 * PERIOD, 0.3 * PERIOD),
        (0.0085, 0.0035),
        (0.0499, 0.0049),
    ],
)
WHICH = [0, 1, 2, 3, 10, 100, 1234, 2998]


def is_in_force(block, name, rows, delay, offset):
    """Row k from k * period + delay on, and not before; before row 0 arrives, row 0."""
    assert block.timing == pytest.approx((offset, PERIOD), rel=1e-12, abs=0)
    late = round((delay - offset) / PERIOD)  # samples taken before row 0 arrives
    for i in range(late):
        block.sample(time=offset + i * PERIOD)
        np.testing.assert_allclose(block.output(name), rows[0], rtol=0, atol=1e-9)
    for k in WHICH:
        instant = offset + (k + late) * PERIOD  # as Drake counts
        assert instant == pytest.approx(k * PERIOD + delay, rel=1e-12)
        block.sample(time=instant)
        np.testing.assert_allclose(block.output(name), rows[k], rtol=0, atol=1e-9)
        block.context.SetTime(instant + 0.99 * PERIOD)
        np.testing.assert_allclose(block.output(name), rows[k], rtol=0, atol=1e-9)


@DELAYS
def test_delayed_table_is_in_force_from_its_arrival_on(delay, offset):
    block = Alone("SignalTable", signals=SIGNALS, delay=delay)
    is_in_force(block, "alleviating_torque", LOADS.alleviating_torque, delay, offset)


@DELAYS
def test_hold_samples_a_delayed_source_where_its_samples_arrive(delay, offset):
    """And that rests on its first sample until then. The hold starts with nothing."""
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("source", made("ReferenceSource", delay=delay))
    hold = builder.AddNamedSystem("hold", hold_of(MOTION, 3 * N, delay=delay))
    builder.Connect(source.get_output_port(), hold.get_input_port())
    builder.ExportOutput(source.get_output_port(), "source")
    builder.ExportOutput(hold.get_output_port(), "reference")
    both = Alone(builder.Build())
    assert not hold.HasAnyDirectFeedthrough()
    exact(both.output("reference"), np.zeros(3 * N))
    for time, row in [(0.5 * delay, 0), (delay, 0), (1234 * PERIOD + delay, 1234)]:
        both.context.SetTime(time)
        np.testing.assert_allclose(both.output("source"), ROWS[row], rtol=0, atol=1e-9)
    is_in_force(both, "reference", ROWS, delay, offset)


def test_a_table_starts_with_its_first_samples_however_late_it_is():
    block = Alone("SignalTable", signals=SIGNALS, delay=0.0035)
    block.system.rest(block.context)
    for name, samples in SIGNALS.items():
        exact(block.output(name), samples[0])


# --- wiring by name --------------------------------------------------------------------------


def with_parts(**parts):
    builder = DiagramBuilder()
    for name, system in parts.items():
        builder.AddNamedSystem(name, system)
    return builder


def test_signals_go_to_all_inputs_of_their_name_and_what_no_output_has_comes_from_outside():
    builder = with_parts(
        one=Gain(2.0, 1), other=Gain(3.0, 1), sum=Adder(3, 1), wired=PassThrough(1)
    )
    one, wired = (builder.GetSubsystemByName(name) for name in ("one", "wired"))
    builder.Connect(one.get_output_port(), wired.get_input_port())  # no input is connected twice
    aliases = {("one", "y0"): "a", ("other", "y0"): "b", ("other", "u0"): "a"}
    aliases |= {("one", "u0"): "x", ("sum", "u0"): "a", ("sum", "u1"): "b", ("sum", "u2"): "x"}
    outputs = connect_by_name(builder, aliases)
    assert outputs.keys() == {"a", "b", "sum", "y"}
    builder.ExportOutput(outputs["sum"], "sum")
    both = Alone(builder.Build())
    both.give(x=[1.0])
    exact(both.output("sum"), [2 + 6 + 1])


@pytest.mark.parametrize(
    ("parts", "aliases", "message"),
    [
        (
            {"one": Gain(2.0, 1), "other": Gain(3.0, 1)},
            {},
            "signal 'y0': output of one and of other, expected only one",
        ),
        (
            {"one": Gain(2.0, 1), "other": PassThrough(1)},
            {("other", "y"): "y0"},
            "signal 'y0': output of one and of other, expected only one",
        ),
        (
            {"one": Gain(2.0, 1), "other": PassThrough(3)},
            {("other", "u"): "y0"},
            "other: input 'u' has length 3, expected 1",
        ),
    ],
    ids=["same name", "same alias", "length"],
)
def test_signals_that_cannot_be_meant_are_refused(parts, aliases, message):
    with pytest.raises(InputError) as error:
        connect_by_name(with_parts(**parts), aliases)
    assert str(error.value) == message


def test_logs_have_the_names_and_periods_they_are_given():
    builder = DiagramBuilder()
    port = builder.AddNamedSystem("constant", ConstantVectorSource([1.0, 2.0])).get_output_port()
    sinks = add_logs(builder, {"a": port, "b": port}, 0.25)
    diagram = builder.Build()
    assert sinks["a"] is sinks["b"] is diagram.GetSubsystemByName("log.a")
    simulator = Simulator(diagram)
    simulator.AdvanceTo(1.0)
    log = sinks["a"].FindLog(simulator.get_context())
    exact(log.sample_times(), [0, 0.25, 0.5, 0.75, 1])
    exact(log.data()[:, -1], [1, 2])
