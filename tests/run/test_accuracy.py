"""What `accuracy` promises: shipped scenarios against runs that are a hundred times tighter."""

import dataclasses

import numpy as np
import pytest

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.motion import Motion
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import simulate

# Where motors saturate most, and other hard parts of motions.
PARTS = [
    ("axis_pi", "pi", 9.2, 10.4),
    ("coupled_pi", "inverse_dynamics", 9.2, 9.7),
    ("uncertain", "pi_scheduled", 9.2, 9.6),
    ("training", "p_pi+id", 6.3, 6.7),
]


@pytest.mark.parametrize(("name", "label", "start", "end"), PARTS)
def test_speeds_and_positions_are_as_good_as_it_says(robot, name, label, start, end):
    scenario = with_controller(load_scenario(name), label)
    # One count of an encoder more or less moves speeds by 2e-4 rad/s at any accuracy.
    scenario.drive.encoder_resolution = None
    whole = make_design(scenario, robot=robot).wanted
    rows = slice(round(start / whole.period), round(end / whole.period))
    motion = Motion(whole.period, whole.q[rows], whole.v[rows], whole.vd[rows])
    runs = {}
    for accuracy in (1e-3, 1e-4, 1e-6):
        own = dataclasses.replace(scenario, accuracy=accuracy)
        runs[accuracy] = simulate(make_design(own, robot=robot, motion=motion))
    exact = runs.pop(1e-6)
    off = {accuracy: np.abs(run.v - exact.v).max() for accuracy, run in runs.items()}
    assert scenario.accuracy == 1e-4
    assert off[1e-4] < 1e-4 and off[1e-3] < 5e-4, off
    assert np.abs(runs[1e-4].q - exact.q).max() < 1e-5
