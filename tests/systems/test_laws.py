"""Every block without Python in it against its law by hand: values, and AutoDiff's slopes."""

import numpy as np
import pytest
from alone import LIMIT, Alone, N, exact, inputs_of, made, outputs_of
from laws import CASES, TIME
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff


def sizes_of_state(context):
    """Of the continuous state, and of each group of the discrete one."""
    discrete = context.get_discrete_state()
    groups = [discrete.get_vector(k).size() for k in range(discrete.num_groups())]
    return [context.num_continuous_states(), *groups]


def evaluate(diagram, x, inputs):
    """Outputs, and rates and next samples, of a diagram of any scalar type."""
    context = diagram.CreateDefaultContext()
    context.SetTime(TIME)
    for name, value in inputs.items():
        diagram.GetInputPort(name).FixValue(context, value)
    continuous, *samples = np.split(x, np.cumsum(sizes_of_state(context))[:-1])
    change = []
    if len(continuous):
        context.SetContinuousState(continuous)
    for k, sample in enumerate(samples):
        context.SetDiscreteState(k, sample)
    if len(continuous):
        change += list(diagram.EvalTimeDerivatives(context).CopyToVector())
    if samples:
        update = diagram.EvalUniquePeriodicDiscreteUpdate(context)
        for k in range(len(samples)):
            change += list(update.get_vector(k).CopyToVector())
    return {name: port.Eval(context) for name, port in outputs_of(diagram).items()}, change


def tries(diagram, scales, count):
    """Random states and inputs."""
    rng = np.random.default_rng(9)
    size = sum(sizes_of_state(diagram.CreateDefaultContext()))
    for _ in range(count):
        x = rng.normal(size=size) * scales.get("x", 1.0)
        yield (
            x,
            {
                name: rng.normal(size=port.size()) * scales.get(name, 1.0)
                for name, port in inputs_of(diagram).items()
            },
        )


OF_EACH = pytest.mark.parametrize("case", CASES, ids=lambda case: case.title)


@OF_EACH
def test_law(case):
    diagram = made(case.block, **case.changes)
    for x, inputs in tries(diagram, case.scales, 50):
        outputs, change = evaluate(diagram, x, inputs)
        expected, expected_change = case.law(x, **inputs)
        assert outputs.keys() == expected.keys()
        for name, value in outputs.items():
            size = np.max(np.abs(expected[name]), initial=1e-300)
            np.testing.assert_allclose(value, expected[name], rtol=1e-12, atol=1e-12 * size)
        size = np.max(np.abs(expected_change), initial=1e-300)
        np.testing.assert_allclose(change, expected_change, rtol=1e-12, atol=1e-12 * size)


@OF_EACH
def test_autodiff_gives_the_slope_of_the_law(case):
    diagram = made(case.block, **case.changes)
    converted = diagram.ToAutoDiffXd()
    for x, inputs in tries(diagram, case.scales, 8):
        sizes = [len(x), *map(len, inputs.values())]
        flat = np.concatenate([x, *inputs.values()])
        steps = 1e-5 * np.maximum(np.abs(flat), 1e-3)

        def split(values, sizes=sizes, names=tuple(inputs)):
            x, *rest = np.split(values, np.cumsum(sizes)[:-1])
            return x, dict(zip(names, rest, strict=True))

        def law(values, split=split):
            x, inputs = split(values)
            outputs, change = case.law(x, **inputs)
            return np.concatenate([*outputs.values(), change])

        outputs, change = evaluate(converted, *split(InitializeAutoDiff(flat).ravel()))
        actual = ExtractGradient(np.concatenate([*outputs.values(), change])[:, None])
        slopes = [(law(flat + s) - law(flat - s)) / (2 * s.sum()) for s in np.diag(steps)]
        expected = np.transpose(slopes)
        if not actual.size:  # of constants, Drake gives no gradient at all
            actual = np.zeros_like(expected)
        size = np.abs(expected).max(axis=1, keepdims=True)
        assert np.all(np.abs(actual - expected) <= 1e-5 * size)


# --- where random tries do not get -----------------------------------------------------------


@pytest.mark.parametrize("alleviating", [0.0, 30.0, -30.0])
@pytest.mark.parametrize("tau_cmd", [50.0, 150.0, -150.0])
def test_saturation_can_be_differentiated_where_no_help_widens_it(tau_cmd, alleviating):
    """At a = 0 as well."""
    diagram = made("DynamicSaturation", motor_torque_limit=[100.0]).ToAutoDiffXd()
    context = diagram.CreateDefaultContext()
    inputs = InitializeAutoDiff([tau_cmd, alleviating])
    diagram.GetInputPort("tau_cmd").FixValue(context, inputs[0])
    diagram.GetInputPort("alleviating_torque").FixValue(context, inputs[1])
    tau = diagram.GetOutputPort("tau").Eval(context)[0]
    if abs(tau_cmd) == 50:
        value, gradient = tau_cmd, [1, 0]
    else:
        widened = tau_cmd * alleviating > 0
        value, gradient = np.sign(tau_cmd) * (130 if widened else 100), [0, widened]
    assert tau.value() == value
    exact(tau.derivatives(), gradient)


def test_saturation_passes_every_bit_of_what_is_within():
    """Or motors would seem to saturate."""
    block = Alone("DynamicSaturation", motor_torque_limit=LIMIT)
    for share in [*np.random.default_rng(4).uniform(-1, 1, size=(50, N)), np.ones(N)]:
        block.give(tau_cmd=share * LIMIT, alleviating_torque=np.zeros(N))
        exact(block.output("tau"), share * LIMIT)
