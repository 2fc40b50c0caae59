"""Studies as data: distributions, draws, rows, fields, and what is refused."""

import math
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sdt_drake.io.errors import InputError
from sdt_drake.robot.device import Friction
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.run.scenario import Scenario, load_scenario
from sdt_drake.studies.distributions import Choice, Grid, List, LogUniform, Normal, Uniform
from sdt_drake.studies.sizing import load_sizing
from sdt_drake.studies.study import Study, Variable, load_study


@pytest.fixture
def base(files) -> Scenario:
    return load_scenario(files / "axis.yaml")


def variable(distribution, field="disturbance.amplitude", **options) -> Variable:
    options = {"name": field} | options
    return Variable(fields=[field], distribution=distribution, **options)


# --- distributions ---------------------------------------------------------------------------


@given(st.floats(-100, 100), st.floats(0.01, 100), st.floats(-3, 2.9), st.floats(0.1, 6))
def test_quantile_inverts_the_distribution(mean, std, first, width):
    """Against distribution functions of the standard library."""
    low, high = mean + first * std, mean + (first + width) * std
    normal, shares = NormalDist(mean, std), np.linspace(0, 1, 21)
    below, within = normal.cdf(low), normal.cdf(high) - normal.cdf(low)
    for distribution, share_of in (
        (Uniform(low, high), lambda x: (x - low) / (high - low)),
        (LogUniform(std, 9 * std), lambda x: math.log(x / std) / math.log(9)),
        (Normal(mean, std, low, high), lambda x: (normal.cdf(x) - below) / within),
        (Normal(mean, std), normal.cdf),
        (Normal(mean, std, low), lambda x: (normal.cdf(x) - below) / (1 - below)),
    ):
        inner = shares[1:-1] if distribution == Normal(mean, std) else shares[:-1]
        values = distribution.quantile(inner)
        np.testing.assert_allclose([share_of(x) for x in values], inner, atol=1e-7)
    ends = Normal(mean, std, low, high).quantile(shares[[0, -1]])
    np.testing.assert_allclose(ends, [low, high], rtol=1e-9, atol=1e-9)


BAD_VARIABLES = [
    (Uniform, (1, 1), "period", "low 1, high 1, expected low < high"),
    (Normal, (0, 1, 40), "period", "less than 1e-6 of the distribution lies between"),
    (List, ([1.0, 2.0, 1.0],), "period", r"values: \[1.0, 2.0, 1.0\] has a value twice"),
    (Uniform, (0, 1), "controller.anti_windup", r"gets numbers, expected texts \(!Choice\)"),
    (Choice, (["true", "maybe"],), "controller.anti_windup", "'maybe', expected true or false"),
    (Choice, (["a\0.yaml"],), "motion", r"values: 'a\\x00.yaml', expected printable"),
]


@pytest.mark.parametrize(("distribution", "numbers", "field", "message"), BAD_VARIABLES)
def test_bad_variables_are_refused(base, distribution, numbers, field, message):
    with pytest.raises(InputError, match=message):
        Study(variables=[variable(distribution(*numbers), field)]).validate(base)


U = variable(Uniform(0, 1))
ZETA = variable(Uniform(0, 1), "controller.zeta", name="a")
ZETA_2 = variable(Uniform(0, 1), "controller.zeta[2]", name="b")
BAD_STUDIES = [
    ([U, U], {}, "disturbance.amplitude names two variables"),
    ([variable(Grid(0, 1))], {"draws": 2}, "draws: 2, but no variable is random; remove"),
    ([U], {"draws": 10**8}, "runs, expected at most 10,000,000"),
    ([U], {"name": "../x"}, "name: ../x, expected the name of a folder"),
    ([ZETA, ZETA_2], {}, r"controller.zeta\[2\] is set by a and b"),
    ([], {}, "variables: none, expected at least one"),
]
BAD_ONES = [
    ({"distribution": List([1.0])}, "fields: none"),
    ({"fields": ["period"]}, "distribution: missing, expected !Uniform, !Normal"),
    ({"fields": ["period"], "distribution": List([1.0]), "name": "rms_torque_share_4"},
     "name: rms_torque_share_4 is a column of the results"),
]  # fmt: skip


@pytest.mark.parametrize(("variables", "options", "message"), BAD_STUDIES)
def test_bad_study_fields_are_refused(base, variables, options, message):
    with pytest.raises(InputError, match=message):
        Study(variables=variables, **options).validate(base)


@pytest.mark.parametrize(("fields", "message"), BAD_ONES)
def test_bad_fields_of_a_variable_are_refused(fields, message):
    with pytest.raises(InputError, match=f"^variable.*: {message}"):
        Variable(**fields)


# --- draws -----------------------------------------------------------------------------------


def drawn(*variables, of=0, draws=200, **options):
    study = Study(draws=draws, variables=list(variables), **options)
    return np.array(
        [study.inputs(draw * study.per_draw)[variables[of].name] for draw in range(draws)]
    )


def test_latin_hypercube_has_one_draw_in_each_interval():
    values = drawn(variable(Normal(0, 1)), draws=50, sampling="latin_hypercube")
    edges = Normal(0, 1).quantile(np.arange(1, 50) / 50)
    assert sorted(np.searchsorted(edges, values)) == list(range(50))


@pytest.mark.parametrize("sampling", ["random", "latin_hypercube"])
def test_draws_do_not_depend_on_other_variables(sampling):
    own, options = variable(Uniform(0, 1)), {"sampling": sampling, "seed": 3}
    alone = drawn(own, **options)
    other, levels = variable(Normal(0, 1), "period"), variable(Grid(1, 2, 3), "torque_margin")
    np.testing.assert_array_equal(drawn(other, levels, own, of=2, **options), alone)
    assert abs(np.corrcoef(drawn(other, own, **options), alone)[0, 1]) < 0.25


def test_draws_equal_committed_numbers():
    """What a study gave last year it gives today: these are numbers of PCG64."""
    study = Study(draws=2, seed=7, variables=[variable(Uniform(0, 1), name="x")])
    expected = np.random.default_rng([7, 0x8CDC1683]).random(2)  # CRC-32 of "x"
    assert [study.inputs(row)["x"] for row in range(2)] == expected.tolist()


def test_every_draw_has_every_combination():
    levels = [variable(Choice(["a", "b"]), "algorithm"), variable(List([1.0, 2.0, 3.0]), "period")]
    study = Study(draws=3, variables=[levels[0], variable(Uniform(0, 1)), levels[1]])
    rows = [study.inputs(row) for row in range(len(study))]
    assert list(rows[0]) == ["algorithm", "disturbance.amplitude", "period"]
    combinations = [(kind, period) for kind in "ab" for period in (1, 2, 3)]
    assert [(row["algorithm"], row["period"]) for row in rows] == 3 * combinations
    amplitudes = np.reshape([row["disturbance.amplitude"] for row in rows], (3, 6))
    assert np.all(amplitudes == amplitudes[:, :1]) and len(np.unique(amplitudes)) == 3


# --- into the scenario -----------------------------------------------------------------------


def test_row_gives_the_scenario_of_its_inputs(base):
    study = Study(
        variables=[
            Variable("z", ["controller.zeta", "controller.omega_ratio"], "value", Uniform(1, 2)),
            Variable("r", ["controller.omega_r"], "factor", List([2.0])),
            Variable("a", ["disturbance.amplitude"], "offset", List([0.5])),
            Variable("c", ["controller"], "value", Choice(["p_pi+id"])),
            Variable("w", ["controller.anti_windup"], "value", Choice(["true"])),
        ]
    )
    study.validate(base)
    inputs = {"z": 1.5, "r": 2.0, "a": 0.5, "c": "p_pi+id", "w": "true"}
    changes = {"kind": "p_pi", "feedforward": "id", "zeta": [1.5] * 4, "omega_ratio": 1.5}
    changes |= {"omega_r": 2 * 65.991, "anti_windup": True}
    expected = {f"controller.{name}": value for name, value in changes.items()}
    expected |= {"disturbance.amplitude": 0.5, "accuracy": 1e-3}  # of studies
    assert base.changed(study.changes(base, inputs)) == base.changed(expected)
    assert base.controller.kind == "pi"


# --- fields by dotted name -------------------------------------------------------------------


@pytest.fixture
def scenario() -> Scenario:
    """With a friction and a device."""
    device = DeviceChoice(motors=["a", "b"], fitted=["", ""])
    changes = {"device": device, "plant.friction": Friction(coulomb=[1.0, 2.0, 4.0])}
    return load_scenario("coupled_pi", changes)


def test_change_that_the_study_overwrites_is_refused():
    for kept in ({"controller.omega_ratio": 0.4}, {"plant.friction.coulomb[2]": 3}):  # it scales
        assert load_study("monte_carlo", kept)[1] == load_scenario("uncertain", kept)
    for lost in ("controller.kind", "plant.deviation.payload_mass", "accuracy"):
        with pytest.raises(InputError, match=rf"^{lost}: .*monte_carlo.yaml sets"):
            load_study("monte_carlo", {lost: 1})
    with pytest.raises(InputError, match=r"^device.motors\[1\]: .*sizing.yaml sets device itself"):
        load_sizing("sizing", {"device.motors[1]": "AC-203"})
