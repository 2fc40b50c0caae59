"""The integrator of a run: every one follows the loop by hand, and what is refused."""

import typing

import numpy as np
import pytest
from oracles.by_hand import robot_by_hand

from sdt_drake.io.errors import InputError
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import Scenario, load_scenario, save_scenario
from sdt_drake.run.simulate import make_simulator, simulate
from sdt_drake.run.simulation import NO_ESTIMATE, SimulationChoice

SCHEMES = typing.get_args(typing.get_type_hints(SimulationChoice)["integration_scheme"])


@pytest.fixture(scope="module")
def by_hand(designed):
    return robot_by_hand(designed("coupled_pi_ctc", end=0.6))[:, 1]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_integrator_follows_the_loop_by_hand(scheme, designed, by_hand):
    """The first order ones err by 1e-3 rad/s at most, the others by 2e-5."""
    chosen = {"simulation.integration_scheme": scheme}
    if scheme in NO_ESTIMATE:
        chosen |= {"simulation.use_error_control": False, "simulation.max_step_size": 5e-4}
    run = simulate(designed("coupled_pi_ctc", chosen, end=0.6))
    worst = np.abs(run.v - by_hand).max()
    assert worst < (1e-3 if "euler" in scheme or scheme == "radau1" else 2e-5)


@pytest.mark.parametrize(("step", "per_period"), [(1e-3, 5), (2.5e-3, 2), (None, 1), (1.0, 1)])
def test_fixed_steps_are_the_largest_ones_from_sample_to_sample(step, per_period, designed):
    loop = make_loop(designed("coupled_pi", end=0.1))
    chosen = SimulationChoice(max_step_size=step, use_error_control=False)
    simulator = make_simulator(loop.diagram, period=0.005, accuracy=1e-4, simulation=chosen)
    loop.set_steady_state(simulator.get_mutable_context())
    lengths = []

    def monitor(context):
        lengths.append(context.get_time())

    simulator.set_monitor(monitor)
    simulator.AdvanceTo(0.1)
    steps = np.diff(lengths)
    assert np.count_nonzero(steps > 1e-12) == 20 * per_period
    assert steps.max() == pytest.approx(0.005 / per_period)


def test_accuracy_is_the_short_form_of_that_of_the_simulation(designed, tmp_path):
    short = load_scenario("coupled_pi", {"accuracy": 1e-6})
    long = load_scenario("coupled_pi", {"simulation.accuracy": 1e-6})
    assert long == short and long.accuracy == 1e-6
    assert long.changed({"accuracy": 1e-3}).accuracy == 1e-3  # as studies do
    fixed = long.changed({"simulation.integration_scheme": "radau3"})
    save_scenario(fixed, file := tmp_path / "fixed.yaml")
    assert load_scenario(file) == fixed != long


@pytest.mark.parametrize(
    ("field", "values", "message"),
    [
        ("integration_scheme", {"integration_scheme": "rk4"}, "'rk4'"),
        (
            "max_step_size",
            {"max_step_size": 1e-7},
            "1e-07, expected a number >= 1e-06 and <= 1 [s]",
        ),
        ("max_step_size", {"max_step_size": 2}, "2, expected a number >= 1e-06 and <= 1 [s]"),
        ("accuracy", {"accuracy": 1}, "1, expected a number >= 1e-12 and <= 0.01 [rad/s]"),
        ("accuracy", {"accuracy": 1e-5, "use_error_control": False}, "no effect without"),
        ("use_error_control", {"integration_scheme": "runge_kutta2"}, "true, but runge_kutta2"),
    ],
)
def test_a_bad_integrator_is_one_line_with_its_field_and_limits(field, values, message):
    with pytest.raises(InputError) as refused:
        Scenario(controller={"omega_r": 60}, simulation=values)
    [line] = f"{refused.value}".splitlines()
    assert f"simulation.{field}: {message}" in line


def test_two_accuracies_are_refused():
    with pytest.raises(InputError, match=r"simulation\.accuracy: 1e-05, but accuracy is 0\.001"):
        load_scenario("coupled_pi", {"simulation.accuracy": 1e-5, "accuracy": 1e-3})


@pytest.mark.parametrize(
    ("stops", "message"),
    [
        ({"restitution": 0.5}, "stiffness: missing, expected one for each joint"),
        ({"stiffness": [1e5] * 4}, "stiffness[1]: 100000, but joint 1 'planetary' has no stop in"),
        ({"stiffness": [1e5] * 3}, "stiffness: 3 value(s), expected 4, one for each joint"),
        ({"stiffness": [-1.0] * 4}, "stiffness[1]: -1.0, expected a number >= 0 [N m/rad]"),
        (
            {"restitution": 1.5, "stiffness": [0.0]},
            "restitution: 1.5, expected a number >= 0 and <= 1",
        ),
    ],
)
def test_bad_stops_are_one_line_with_their_field_and_limits(stops, message, designed):
    changes = {f"plant.stops.{name}": value for name, value in stops.items()}
    with pytest.raises(InputError) as refused:
        designed("coupled_pi", changes, end=0.1)
    assert f"plant.stops.{message}" in f"{refused.value}".splitlines()[0]


def test_the_axis_plant_has_no_stops(designed):
    with pytest.raises(InputError, match=r"plant\.stops: the axis plant has none; remove, or set"):
        designed("axis_pi", {"plant.stops.stiffness": [1e5] * 4}, end=0.1)
