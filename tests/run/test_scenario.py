"""Scenarios: YAML in and out, paths, designs, and what is refused."""

import numpy as np
import pytest

from sdt_drake.io.resources import find_file
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import (
    DisturbanceChoice,
    Scenario,
    load_scenario,
    save_scenario,
)

# Table 1.
I_EFF = [4.26, 98.01, 796.3, 250.28]
KP = [267.1, 6.34e3, 5.2e4, 1.57e4]
KI = [4.64e3, 1.07e5, 8.67e5, 2.73e5]
STILL = "duration: 1\njoints:\n" + 4 * "  - !Knots {knots: [[0, 0], [1, 0]]}\n"


@pytest.fixture
def load(tmp_path):
    """Write the text of a scenario and load it."""

    def load_text(text: str) -> Scenario:
        (path := tmp_path / "run.yaml").write_text(text, encoding="utf-8")
        return load_scenario(path)

    return load_text


def test_shipped_scenarios_have_the_published_numbers(designed):
    for name, amplitude in (("axis_pi", 0.0), ("axis_pi_ctc", 0.05)):
        design = designed(name)
        scenario = design.scenario
        assert scenario.controller.setpoint_weight == 0
        assert scenario.algorithm == "printed"
        assert repr(scenario).startswith(f"<Scenario {name}: PI")
        assert scenario.disturbance == DisturbanceChoice(amplitude, 2 * np.pi)
        numbers = design.i_eff, design.tuning.gains.kp, design.tuning.gains.ki
        np.testing.assert_array_equal(numbers, (I_EFF, KP, KI))
    for name in ("coupled_pi", "coupled_pi_ctc"):
        design = designed(name)
        assert design.scenario.algorithm == "consistent"
        # The paper prints 2.73e5 for joint 4; its own formula gives 2.7248e5.
        np.testing.assert_allclose(
            design.tuning.gains.ki, [4.64e3, 1.067e5, 8.67e5, 2.7248e5], rtol=1e-3
        )
        np.testing.assert_allclose(design.tuning.gains.kp, KP, rtol=5e-3)
    # Without zeta it is 1: K_PS = 2 I_eff omega_n with omega_n = omega_r / 2.
    design = designed("coupled_pi", {"controller.zeta": None})
    np.testing.assert_allclose(design.tuning.gains.kp, 65.991 * design.inertia.maximum, rtol=1e-12)


def test_scenario_gives_feedforward_weight_and_label():
    for kind, feedforward, *expected in (
        ("pi_id", None, "id", 1, "pi_id"),
        ("p_pi", "none", "none", 1, "p_pi"),
        ("pi_scheduled", "ctc", "ctc", 0, "pi_scheduled+ctc"),
    ):
        fields = {"kind": kind, "feedforward": feedforward, "omega_r": 66.0}
        choice = Scenario(controller=fields).controller
        found = choice.feedforward_in_use, choice.setpoint_weight, choice.label
        assert found == tuple(expected)


PROJECT = """robot: robots/own.sdf
motion: ../still.yaml
device: {catalogue: own_motors.yaml}
controller: {omega_r: 60}
"""


def test_scenario_paths_are_relative_to_its_file_and_survive_saving(tmp_path, monkeypatch):
    folder = tmp_path / "project" / "runs"
    (folder / "robots").mkdir(parents=True)
    (folder / "robots" / "own.sdf").write_bytes(find_file("package://sdt/sdt.sdf").read_bytes())
    (folder / "own_motors.yaml").write_bytes(find_file("motors", "motors").read_bytes())
    (folder.parent / "still.yaml").write_text(STILL)
    (folder / "first_run.yaml").write_text(PROJECT)
    monkeypatch.chdir(tmp_path / "project")
    scenario = load_scenario("runs/first_run.yaml")
    design = make_design(scenario)
    assert design.device.simulated.path.samefile(folder / "robots" / "own.sdf")
    assert design.reference.tracked.duration == 1
    assert scenario.device.catalogue == str(folder / "own_motors.yaml")
    save_scenario(scenario, tmp_path / "results" / "copy.yaml")
    assert load_scenario(tmp_path / "results" / "copy.yaml") == scenario
