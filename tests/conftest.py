"""Shared fixtures: the reference device and its designs, made once."""

from __future__ import annotations

import copy

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

from sdt_drake.design import Design, make_design
from sdt_drake.robot import Robot, load_robot
from sdt_drake.scenario import Scenario, load_scenario


@pytest.fixture(autouse=True)
def _clean_figures_and_seed():
    np.random.seed(0)
    yield
    import matplotlib.pyplot as plt

    plt.close("all")


@pytest.fixture(scope="session")
def robot() -> Robot:
    """The reference device."""
    return load_robot()


@pytest.fixture(scope="session")
def _reference_design() -> Design:
    return make_design(load_scenario("package://sdt/scenarios/coupled_pi_ctc.yaml"))


@pytest.fixture
def design(_reference_design: Design) -> Design:
    """The shipped coupled PI + CTC run; do not change it."""
    return _reference_design


@pytest.fixture
def make_variant(_reference_design: Design):
    """A design from a changed copy of a shipped scenario, sharing robot and motion.

    `change` gets the copy and modifies it in place.
    """

    def make(name: str, change=None) -> Design:
        scenario: Scenario = copy.deepcopy(load_scenario(f"package://sdt/scenarios/{name}.yaml"))
        if change is not None:
            change(scenario)
        return make_design(scenario, robot=_reference_design.robot, motion=_reference_design.motion)

    return make
