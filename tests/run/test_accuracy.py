"""What `accuracy` promises: shipped scenarios against runs that are a hundred times tighter."""

import copy

import numpy as np
import pytest

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.motion import Motion
from sdt_drake.run.design import make_design, plan_of
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import simulate

# Where motors saturate most, 9.2 to 10.4 s, every kind of controller on the axis plant; elsewhere
# a hard part. `wrong_model` is `uncertain` with another feedforward.
PARTS = {
    "axis_pi": (9.2, 10.4, ["pi", "p_pi+id"]),
    "axis_pi_ctc": (9.2, 9.8, ["pi_id"]),
    "coupled_pi": (9.2, 9.7, ["pi", "inverse_dynamics"]),
    "coupled_pi_ctc": (0.0, 0.5, ["p_pi"]),
    "uncertain": (9.2, 9.6, ["pi_scheduled"]),
    "wrong_model": (9.2, 9.6, ["p_pi+id"]),
    "real_device": (9.2, 9.4, ["pi_id"]),
    "training": (6.3, 6.7, ["p_pi+id"]),
}
CASES = [(name, label) for name, (*_, labels) in PARTS.items() for label in labels]


@pytest.fixture(scope="module")
def along_a_part(robot):
    """Scenario and motion of a part of it."""
    made = {}

    def make(name):
        if name not in made:
            scenario = load_scenario(f"package://sdt/scenarios/{name}.yaml")
            # One count of an encoder more or less moves speeds by 2e-4 rad/s at any accuracy.
            scenario.drive.encoder_resolution = None
            whole = plan_of(scenario, robot).motion
            rows = slice(*(round(time / whole.period) for time in PARTS[name][:2]))
            parts = (getattr(whole, field)[rows] for field in ("q", "v", "vd"))
            made[name] = scenario, Motion(whole.period, *parts)
        return made[name]

    return make


@pytest.mark.parametrize(("name", "label"), CASES)
def test_speeds_and_positions_are_as_good_as_it_says(along_a_part, robot, name, label):
    scenario, motion = along_a_part(name)
    runs = {}
    for accuracy in (1e-3, 1e-4, 1e-6):
        own = copy.deepcopy(with_controller(scenario, label))
        own.accuracy = accuracy
        runs[accuracy] = simulate(make_design(own, robot=robot, motion=motion))
    exact = runs.pop(1e-6)
    off = {accuracy: np.abs(run.v - exact.v).max() for accuracy, run in runs.items()}
    assert scenario.accuracy == 1e-4
    assert off[1e-4] < 1e-4 and off[1e-3] < 5e-4, off
    assert np.abs(runs[1e-4].q - exact.q).max() < 1e-5
