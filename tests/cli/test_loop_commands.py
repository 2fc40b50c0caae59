"""What budget, bode, stability and compare print and write of loops: numbers, units, files."""

from __future__ import annotations

import re

import numpy as np
import pytest
from command_line import (
    AXIS,
    CONTROLLER,
    ENDS,
    JOINTS,
    MODELS,
    RUN,
    SCENARIO,
    SDF,
    columns_of,
    numbers,
    read_csv,
    refused,
    tables,
)

from sdt_drake.analysis.budget import error_budget
from sdt_drake.analysis.frequency_response import frequency_response
from sdt_drake.io.tables import read_table
from sdt_drake.run.design import make_design
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.run.scenario import load_scenario

FELT = ["felt [% of time]", "largest rotation", "rotation about", "largest force", "force along"]

# --- budget and bode ------------------------------------------------------------------------------

PARTS = ("whole", "reference_lag", "load", "disturbance", "saturation", "remainder")


def test_budget_prints_what_it_writes(good, desk):
    out = good("budget", AXIS, "--out", "b.csv").out
    time, columns = read_table(desk / "b.csv")
    (header, *rows), *_ = tables(out)
    assert tuple(columns) == PARTS and header == ["part", *JOINTS]
    np.testing.assert_allclose(time, 0.005 * np.arange(101), atol=1e-12)
    budget = error_budget(make_design(load_scenario(AXIS)))
    np.testing.assert_array_equal(columns["whole"], budget.whole)
    np.testing.assert_array_equal(columns["load"], budget.parts["load"])
    assert [row[0].replace(" ", "_") for row in rows] == list(PARTS)
    for row in rows:
        values = columns[row[0].replace(" ", "_")]
        for k, cell in enumerate(row[1:]):
            rms, largest = map(float, re.fullmatch(r"(\S+) \((\S+)\)", cell).groups())
            assert rms == pytest.approx(np.sqrt(np.mean(values[:, k] ** 2)), rel=0.06, abs=1e-12)
            assert largest == pytest.approx(np.abs(values[:, k]).max(), rel=0.06, abs=1e-12)


@pytest.mark.parametrize("plant", ["axis", "coupled"])
def test_bode_prints_the_margins(good, desk, plant):
    done = good("bode", f"../given/{plant}.yaml", "--time", "0.5", "--out", "b.csv")
    shown = columns_of(done.out)
    response = frequency_response(make_design(load_scenario(f"../given/{plant}.yaml")), sample=100)
    assert shown["joint"] == JOINTS and shown["stable"] == ["yes"] * 4
    for column, name, rounding in (
        ("bandwidth [rad/s]", "bandwidth", 0.0051),
        ("peak [dB]", "peak_db", 0.0051),
        ("at [rad/s]", "peak_omega", 0.0051),
        ("crossover [rad/s]", "crossover", 0.0051),
        ("phase margin [deg]", "phase_margin", 0.051),
        ("modulus margin", "modulus_margin", 0.00051),
        ("damping ratio", "damping", 0.00051),
    ):
        expected = getattr(response, name)
        np.testing.assert_allclose(numbers(shown[column]), expected, atol=rounding, err_msg=name)
    assert shown["gain margin [dB]"] == ["–"] * 4  # of a second-order loop
    header, *rows = read_csv(desk / "b.csv")
    groups = ("tracking_magnitude", "tracking_phase", "loop_gain_magnitude", "loop_gain_phase")
    assert header == ["omega", *(f"{name}_{k}" for name in groups for k in (1, 2, 3, 4))]
    assert np.all(np.isfinite(np.array(rows, dtype=float))) and len(rows) == 4000


def test_bode_says_what_does_not_count_and_what_there_is_not(good, given):
    plain = good("bode", "../given/axis.yaml", "--time", "1.25").out
    assert "note" not in plain and "\nlinear at rest where the motion is at 1.250 s\n" in plain
    largest = good("bode", "../given/axis.yaml").out.splitlines()[-1]
    assert re.search(r"where each joint's inertia is largest, at (\d\.\d+, ){3}\d\.\d+ s$", largest)
    careful = given("careful.yaml", SCENARIO.replace("kind: pi,", "kind: pi, anti_windup: true,"))
    assert good("bode", careful, "--time", "1.25").out == plain.replace("axis:", "careful:", 1)
    rough = SCENARIO.replace("kind: axis", "kind: axis, friction: {viscous: [1, 1, 1, 1]}")
    cascade = good("bode", given("rough.yaml", rough), "--set", "controller.kind=p_pi").out
    assert "the loop cut at the position, sampled every 0.005 s\n" in cascade
    assert "note: the margins are those of the position loops" in cascade
    assert "note: of friction" in cascade and "note: " not in plain
    assert "the loop cut at the motor\n" in plain
    soft = "kind: axis, elasticity: {natural_frequency: [65.991, 0, 0, 0], encoder: link}"
    out = good("bode", given("soft.yaml", SCENARIO.replace("kind: axis", soft))).out
    assert columns_of(out)["stable"][0] == "no"
    assert "note: the margins of an unstable loop say nothing" in out
    inverse = ENDS["coupled"].replace("kind: pi,", "kind: inverse_dynamics,")
    out = good("bode", given("inverse.yaml", inverse), "--time", "0").out
    assert columns_of(out)["bandwidth [rad/s]"] == ["–"] * 4


# --- stability ------------------------------------------------------------------------------------


def test_stability_shows_both_encoders_and_both_drives(good, desk, given, coarse):
    coarse(0.1, 0.25, 0.5, 0.75, 1.0, 1.5)
    out = good("stability", given("d.yaml", SCENARIO + "drive: {period: 0.001}\n")).out
    titles = re.findall(r"^encoder on the (\w+), (.*): damping", out, re.M)
    drives = ("ideal drive", "the scenario's drive")
    assert titles == [(e, d) for e in ("motor", "link") for d in drives]
    for header, *rows in tables(out):
        assert header == ["joint", "0.1", "0.25", "0.5", "0.75", "1", "1.5", "unstable from"]
        assert [row[0] for row in rows] == JOINTS
    motor, _, link, _ = tables(out)
    for row in motor[1:]:
        (damping, over), one = (
            numbers(re.fullmatch(r"(.*), (.*) %", row[i]).groups()) for i in (3, 5)
        )
        assert damping > 0.5 and over == 0
        assert one == pytest.approx([0.2, 25], rel=0.15) and row[7] == "–"
    assert [row[7] for row in link[3:]] == ["–", "–"]
    assert numbers([row[7] for row in link[1:3]]) == pytest.approx([0.332, 0.398], abs=0.002)
    assert link[1][3] == "unstable"


def test_stability_of_which_frequency_and_damping(call, good, desk, given, coarse):
    def border(out):
        return float(tables(out)[1][1][7])

    coarse(0.25, 0.5, 1.0)
    plain = good("stability", "../given/axis.yaml").out
    assert plain.count("ideal drive") == 2 and "scenario's drive" not in plain
    damped = good("stability", "../given/axis.yaml", "--damping", "0.02").out
    assert border(damped) > border(plain) + 0.01
    springs = "{kind: axis, elasticity: {natural_frequency: [9, 9, 9, 9], damping_ratio: 0.02}}"
    sprung = good("stability", given("springs.yaml", SCENARIO.replace("{kind: axis}", springs))).out
    assert border(sprung) == border(damped)
    assert "damping ratio 0.02" in sprung and "whatever plant.elasticity says" in sprung

    soft = given("soft.yaml", SCENARIO.replace("65.991", "30"))
    assert "omega_r = 30 rad/s (controller.omega_r)" in good("stability", soft).out
    told = good("stability", soft, "--omega-r", "65.991").out
    assert "omega_r = 65.991 rad/s (--omega-r)" in told and tables(told) == tables(plain)
    assert "own gains there: 0.227 0.227 0.227 0.227" in told

    out = good("stability", given("d.yaml", SCENARIO + "device: {structure_scale: 0.8}\n")).out
    text = r"omega_r = (\S+) rad/s \(controller.omega_r, 65.991, times (\S+) for the device\)"
    omega_r, factor = numbers(re.search(text, out).groups())
    assert omega_r == pytest.approx(65.991 * factor, rel=1e-3) != 65.991
    assert "own gains there: 0.500 0.500 0.500 0.500" in out

    gains = "controller: {kind: pi, kp: [267, 6340, 52000, 15700], ki: [4640, 1e5, 8.7e5, 2.7e5]}\n"
    run = given("gains.yaml", SCENARIO.replace(f"{CONTROLLER}}}\n", gains))
    refused(call("stability", run), "--omega-r: missing", "kp")


def test_stability_says_whose_loops_it_sweeps(good, desk, given, coarse):
    """Every controller has a report of its own: its loop, and what has no meaning for it."""
    said = {
        "pi": ["pi, PI speed loops with structure p_in_feedback"],
        "pi_ctc": ["pi_ctc, ", "feedforward", "is left out"],
        "pi_id": ["structure pi\n", "feedforward"],
        "p_pi": [
            "in position loops, K_V = [3.0, 4.0, 5.0, 6.0] 1/s",
            "positions sampled every 0.005 s",
        ],
        "pi_scheduled": ["their gains those at the largest inertia"],
        "inverse_dynamics": ["whole state every 0.005 s", "needs the coupled plant"],
    }
    assert said.keys() == CONTROLLERS.keys()
    coarse(0.1)
    outs = set()
    for kind, parts in said.items():
        own = "p_pi, position_gain: [3, 4, 5, 6]" if kind == "p_pi" else kind
        text = ENDS["coupled"].replace("kind: pi,", f"kind: {own},")
        outs.add(good("stability", given("c.yaml", text)).out)
        for part in parts:
            assert any(part in out for out in outs), kind
    assert len(outs) == len(said)


# --- compare --------------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", ["axis", "coupled"])
def test_compare_runs_all_that_the_plant_allows(good, desk, plant):
    run = {"axis": AXIS, "coupled": RUN}[plant]
    results, felt, systems = tables(good("compare", run).out)
    allowed = {name for name, kind in CONTROLLERS.items() if plant in kind.plants}
    labels = [row[0] for row in systems[1:]]
    assert {label.partition("+")[0] for label in labels} == allowed
    assert results[0][:2] == ["controller", "joint"] and len(results) == 1 + 4 * len(labels)
    assert [row[0] for row in results[1::4]] == labels
    assert systems[0] == ["controller", "blocks", "needs to know"]
    assert felt[0] == ["controller", *FELT] and [row[0] for row in felt[1:]] == labels


def test_compare_prints_what_it_writes(good, desk):
    controllers = ("--controllers", "pi, p_pi+id")
    out = good("compare", "../given/coupled.yaml", *controllers, "--out", "x/c.csv").out
    header, *rows = read_csv(desk / "x" / "c.csv")
    results, felt, _ = tables(out)
    assert out.startswith("coupled: 2 controllers on the coupled plant\n")
    assert out.endswith("x/c.csv written\n")
    assert header[:2] == ["controller", "joint"] and header[2:9] == results[0][2:]
    assert [row[0] for row in rows] == 4 * ["pi"] + 4 * ["p_pi+id"]
    for row, shown in zip(rows, results[1:], strict=True):
        assert shown[-8] == JOINTS[int(row[1]) - 1]
        for value, cell in zip(row[2:9], shown[-7:], strict=True):
            assert float(cell) == pytest.approx(float(value), abs=0.051) if value else cell == "–"
    largest = {row[0]: float(row[2]) for row in rows if row[1] == "2"}
    assert largest["pi"] > 0.1 > 0.01 > largest["p_pi+id"]
    assert header[11:] == FELT and [row[0] for row in felt[1:]] == ["pi", "p_pi+id"]


def test_compare_of_the_real_device_and_of_a_robot_without_a_head(good, desk, given):
    """Friction, a sampled drive, encoders, an envelope, a wrong model: all at once."""
    text = (MODELS / "scenarios" / "real_device.yaml").read_text(encoding="utf-8")
    real = given("real.yaml", text.replace("package://sdt/motions/reference.yaml", "short.yaml"))
    assert good("compare", real, "--controllers", "pi,p_pi+id").out.startswith(
        "real_device: 2 controllers on the coupled plant"
    )
    headless = re.sub(r'<frame name="head".*?</frame>', "", SDF, flags=re.S)
    assert headless != SDF
    given("headless.sdf", headless)
    run = given("headless.yaml", SCENARIO + "robot: headless.sdf\n")
    done = good("compare", run, "--controllers", "pi", "--out", "c.csv")
    assert len(tables(done.out)) == 2 and "felt" not in done.out
    assert read_csv(desk / "c.csv")[0][-1] == "needs"
