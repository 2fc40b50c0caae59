"""`sdt-drake compare`, `budget`, `bode` and `stability` as a user meets them."""

from __future__ import annotations

import csv
import importlib
import re

import numpy as np
import pytest
import test_cli
from test_cli import SHORT, is_one_line, snapshot

from sdt_drake.analysis.budget import error_budget
from sdt_drake.analysis.frequency_response import frequency_response
from sdt_drake.controllers import CONTROLLERS
from sdt_drake.design import make_design
from sdt_drake.scenario import load_scenario
from sdt_drake.tables import read_table

call, good = test_cli.call, test_cli.good

COMMANDS = ("compare", "budget", "bode", "stability")
FIGURE = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
FELT = ["felt [% of time]", "largest rotation", "rotation about", "largest force", "force along"]
JOINTS = ["1 planetary", "2 roll", "3 pitch", "4 yaw"]
# 1.25 s: joint 2 up to 0.5 rad/s within 0.25 s; the others at rest.
MOTION = SHORT.replace("[0.5, 0.5]]", "[1.25, 0.5]]").replace("[0.5, 0]]", "[1.25, 0]]")
MOTION = MOTION.replace("duration: 0.5", "duration: 1.25")
CONTROLLER = "controller: {kind: pi, omega_r: 65.991, zeta: [0.95, 0.98, 0.99, 0.95]"
SCENARIO = f"motion: motion.yaml\nplant: {{kind: axis}}\n{CONTROLLER}}}\n"
ENDS = {"axis": SCENARIO, "coupled": SCENARIO.replace("kind: axis", "kind: coupled")}


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """An empty working directory; scenarios and a motion lie in another one, `../given`."""
    given, folder = tmp_path / "given", tmp_path / "desk"
    given.mkdir()
    folder.mkdir()
    (given / "motion.yaml").write_text(MOTION, encoding="utf-8")
    for name, text in ENDS.items():
        (given / f"{name}.yaml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(folder)
    return folder


def tables(out):
    """Tables that `out` shows: lists of rows of cells, each with its header first."""
    found, rows = [], []
    for line in [*out.splitlines(), ""]:
        cells = re.split(r"\s{2,}", line.strip())
        if len(cells) > 2:
            rows.append(cells)
        elif rows:
            found.append(rows)
            rows = []
    return [rows for rows in found if len(rows) > 1]


def refused(done, *parts):
    """Exit code 2, nothing printed, one line on stderr with all `parts` in it."""
    assert (done.code, done.out) == (2, ""), done
    assert is_one_line(done.err) and "Traceback" not in done.err, done.err
    for part in parts:
        assert part in done.err, done.err


def read_csv(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))


# --- all four -----------------------------------------------------------------------------------


def test_help_lists_all_four(good):
    out = good("--help").out
    for name in COMMANDS:
        assert re.search(rf"^\s+{name}\b", out, re.M), name


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_an_example_with_its_own_options(good, name):
    out = " ".join(good(name, "--help").out.split())
    example = out.partition(f"example: sdt-drake {name} ")[2]
    assert example.startswith("package://sdt/scenarios/")
    for option in re.findall(r"--[a-z-]+", example):
        assert option in out.partition("example:")[0]


@pytest.mark.parametrize(
    ("name", "suffix"), [*((name, "png") for name in COMMANDS), ("bode", "svg"), ("budget", "pdf")]
)
def test_writes_a_figure_from_another_directory(good, desk, name, suffix):
    options = ("--controllers", "pi,pi_id") if name == "compare" else ()
    done = good(name, "../given/axis.yaml", *options, "--out", f"new/figure.{suffix}")

    assert done.out.splitlines()[-1] == f"new/figure.{suffix} written"
    assert [path.name for path in (desk / "new").iterdir()] == [f"figure.{suffix}"]
    content = (desk / "new" / f"figure.{suffix}").read_bytes()
    assert content.startswith(FIGURE[suffix]) and len(content) > 5_000
    assert done.out.startswith("axis")


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("out", ["x.txt", "x", "x.CSV", "csv"])
def test_a_wrong_suffix_is_refused_before_anything_is_computed(call, desk, monkeypatch, name, out):
    def computed(path):
        raise AssertionError("computed")

    monkeypatch.setattr(
        importlib.import_module(f"sdt_drake.commands.{name}"), "design_of", computed
    )
    refused(call(name, "../given/axis.yaml", "--out", out), out, ".png")
    assert list(desk.iterdir()) == []


@pytest.mark.parametrize("name", [*COMMANDS, "simulate"])
def test_a_folder_is_refused_before_anything_is_computed(call, desk, monkeypatch, name):
    def computed(path):
        raise AssertionError("computed")

    monkeypatch.setattr(
        importlib.import_module(f"sdt_drake.commands.{name}"), "design_of", computed
    )
    (desk / "x.png").mkdir()
    refused(call(name, "../given/axis.yaml", "--out", "x.png"), "x.png: is a folder")
    assert list((desk / "x.png").iterdir()) == []


def test_stability_has_no_table_to_write(call, desk):
    refused(call("stability", "../given/axis.yaml", "--out", "x.csv"), "x.csv", ".png")
    assert list(desk.iterdir()) == []


@pytest.mark.parametrize("name", COMMANDS)
def test_no_such_scenario(call, desk, name):
    refused(call(name, "nowhere.yaml", "--out", "x.png"), "nowhere.yaml")
    assert list(desk.iterdir()) == []


@pytest.mark.parametrize("name", COMMANDS)
def test_a_motion_without_motion(good, desk, name):
    """Zeros everywhere are no reason to complain."""
    rest = re.sub(r"\[0.25, 0.5\], \[1.25, 0.5\]", "[1.25, 0]", MOTION)
    (desk.parent / "given" / "motion.yaml").write_text(rest)
    good(name, "../given/axis.yaml", "--out", "rest.png")


BAD = {
    "period": ("drive: {period: 0.002}", "drive.period", "does not divide"),
    "stiff": (
        "plant: {kind: axis, elasticity: {natural_frequency: [0, 1.0e+9, 0, 0]}}",
        "plant.elasticity.natural_frequency",
        "joint 2",
    ),
    "negative friction": (
        "plant: {kind: axis, friction: {coulomb: [1, -2, 3, 4]}}",
        "plant.friction.coulomb",
        "expected a number >= 0",
    ),
    "breakaway": (
        "plant: {kind: axis, friction: {coulomb: [9, 9, 9, 9], breakaway: [9, 9, 8, 9]}}",
        "plant.friction.breakaway",
        "at least coulomb",
    ),
    "unknown": (
        "drive: {torque_bandwith: 600}",
        "drive.torque_bandwith: no such field",
        "did you mean 'torque_bandwidth'?",
    ),
    "n1 alone": ("drive: {n1: [9, 9, 9, 9]}", "drive.n0: ", "missing, expected n1 and n0"),
}


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("name", [*COMMANDS, "simulate"])
def test_a_bad_scenario_is_refused_with_file_and_field(call, desk, name, bad):
    line, field, reason = BAD[bad]
    text = SCENARIO.replace("plant: {kind: axis}", line) if "plant" in line else SCENARIO + line
    file = desk.parent / "given" / "bad.yaml"
    file.write_text(text + "\n", encoding="utf-8")
    before = snapshot(desk.parent)

    refused(call(name, "../given/bad.yaml", "--out", "x.png"), "bad.yaml", field, reason)
    assert snapshot(desk.parent) == before


# --- compare ------------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", ["axis", "coupled"])
def test_compare_runs_all_that_the_plant_allows(good, desk, plant):
    results, felt, systems = tables(good("compare", f"../given/{plant}.yaml").out)

    allowed = {name for name, kind in CONTROLLERS.items() if plant in kind.plants}
    labels = [row[0] for row in systems[1:]]
    assert {label.partition("+")[0] for label in labels} == allowed
    assert results[0][:2] == ["controller", "joint"] and len(results) == 1 + 4 * len(labels)
    assert [row[0] for row in results[1::4]] == labels
    assert systems[0] == ["controller", "blocks", "needs to know"]
    assert felt[0] == ["controller", *FELT] and [row[0] for row in felt[1:]] == labels


def test_compare_prints_what_it_writes(good, desk):
    done = good(
        "compare", "../given/coupled.yaml", "--controllers", "pi, p_pi+id", "--out", "x/c.csv"
    )
    header, *rows = read_csv(desk / "x" / "c.csv")
    results, felt, _ = tables(done.out)

    assert done.out.startswith("coupled: 2 controllers on the coupled plant\n")
    assert done.out.endswith("x/c.csv written\n")
    assert header[:2] == ["controller", "joint"] and header[2:9] == results[0][2:]
    assert [row[0] for row in rows] == 4 * ["pi"] + 4 * ["p_pi+id"]
    for row, shown in zip(rows, results[1:], strict=True):
        assert shown[-8] == JOINTS[int(row[1]) - 1]
        for value, cell in zip(row[2:9], shown[-7:], strict=True):
            if value:
                assert float(cell) == pytest.approx(float(value), abs=0.051)
            else:
                assert cell == "–"
    largest = {row[0]: float(row[2]) for row in rows if row[1] == "2"}
    assert largest["pi"] > 0.1 > 0.01 > largest["p_pi+id"]
    assert header[11:] == FELT
    for label, *shown in felt[1:]:
        for row in (row for row in rows if row[0] == label):
            assert [row[13], row[15]] == [shown[2], shown[4]]
            for k in (11, 12, 14):
                assert float(shown[k - 11]) == pytest.approx(float(row[k]), abs=0.051)


def test_compare_of_a_robot_without_a_head_leaves_the_pilot_out(good, desk):
    robot = (test_cli.MODELS / "sdt.sdf").read_text(encoding="utf-8")
    headless = re.sub(r'<frame name="head".*?</frame>', "", robot, flags=re.S)
    assert headless != robot
    (desk.parent / "given" / "headless.sdf").write_text(headless, encoding="utf-8")
    (desk.parent / "given" / "headless.yaml").write_text(
        ENDS["axis"] + "robot: headless.sdf\n", encoding="utf-8"
    )
    done = good("compare", "../given/headless.yaml", "--controllers", "pi", "--out", "c.csv")
    assert len(tables(done.out)) == 2 and "felt" not in done.out
    assert read_csv(desk / "c.csv")[0][-1] == "needs"


def test_compare_agrees_with_simulate(good, desk):
    good("compare", "../given/axis.yaml", "--controllers", "pi_ctc,pi", "--out", "c.csv")
    good("simulate", "../given/axis.yaml", "--out", "run.csv")
    _, columns = read_table(desk / "run.csv")

    shown = [float(row[2]) for row in read_csv(desk / "c.csv")[5:]]
    assert shown == pytest.approx(np.abs(columns["speed_error"]).max(axis=0), abs=1e-15)


def test_compare_of_the_real_device(good, desk):
    """Friction, a sampled drive, encoders, an envelope, a wrong model: all controllers at once."""
    text = load_text("real_device").replace("package://sdt/motions/reference.yaml", "motion.yaml")
    (desk.parent / "given" / "real.yaml").write_text(text, encoding="utf-8")
    done = good("compare", "../given/real.yaml", "--controllers", "pi,p_pi+id", "--out", "c.png")

    assert done.out.startswith("real_device: 2 controllers on the coupled plant")


def load_text(name):
    return (test_cli.MODELS / "scenarios" / f"{name}.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("controllers", "parts"),
    [
        ("pi,pid", ("--controllers: 'pid'", ", ".join(CONTROLLERS))),
        ("p_pi+pd", ("--controllers: feedforward of p_pi: 'pd'", "none, ctc, id")),
        ("pi+id", ("--controllers: 'pi+id'", "has its own feedforward")),
        ("pi,p_pi,pi", ("--controllers: 'pi' is given twice",)),
        ("", ("--controllers: none given",)),
        (" , ", ("--controllers: none given",)),
        ("pi,inverse_dynamics", ("inverse_dynamics", "plant.kind coupled")),
    ],
)
def test_compare_refuses_controllers(call, desk, controllers, parts):
    done = call("compare", "../given/axis.yaml", "--controllers", controllers, "--out", "x.png")
    refused(done, *parts)
    assert list(desk.iterdir()) == []


# --- budget -------------------------------------------------------------------------------------

PARTS = ("whole", "reference_lag", "load", "disturbance", "saturation", "remainder")


def test_budget_prints_what_it_writes(good, desk):
    done = good("budget", "../given/axis.yaml", "--out", "b.csv")
    time, columns = read_table(desk / "b.csv")
    (rows,) = tables(done.out)

    assert tuple(columns) == PARTS
    np.testing.assert_allclose(time, 0.005 * np.arange(251), atol=1e-12)
    np.testing.assert_allclose(
        sum(columns[name] for name in PARTS[1:]), columns["whole"], atol=1e-15
    )
    budget = error_budget(make_design(load_scenario("../given/axis.yaml")))
    np.testing.assert_array_equal(columns["whole"], budget.whole)
    np.testing.assert_array_equal(columns["load"], budget.parts["load"])
    assert rows[0] == ["part", *JOINTS]
    assert [row[0].replace(" ", "_") for row in rows[1:]] == list(PARTS)
    for row in rows[1:]:
        values = columns[row[0].replace(" ", "_")]
        for k, cell in enumerate(row[1:]):
            rms, largest = map(float, re.fullmatch(r"(\S+) \((\S+)\)", cell).groups())
            assert rms == pytest.approx(np.sqrt(np.mean(values[:, k] ** 2)), rel=0.06, abs=1e-12)
            assert largest == pytest.approx(np.abs(values[:, k]).max(), rel=0.06, abs=1e-12)


def test_budget_refuses_the_coupled_plant(call, desk):
    done = call("budget", "../given/coupled.yaml", "--out", "x.csv")
    refused(done, "plant.kind: coupled", "expected axis")
    assert list(desk.iterdir()) == []


def test_budget_refuses_online_inverse_dynamics(call, desk):
    (desk.parent / "given" / "online.yaml").write_text(SCENARIO + "inverse_dynamics: online\n")
    refused(call("budget", "../given/online.yaml", "--out", "x.png"), "inverse_dynamics: online")
    assert list(desk.iterdir()) == []


# --- bode ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", ["axis", "coupled"])
def test_bode_prints_the_margins(good, desk, plant):
    (header, *rows), *_ = tables(good("bode", f"../given/{plant}.yaml", "--time", "0.5").out)
    response = frequency_response(make_design(load_scenario(f"../given/{plant}.yaml")), sample=100)

    assert [row[0] for row in rows] == JOINTS and len(header) == 8
    shown = np.array([[float(cell) for cell in row[1:7]] for row in rows]).T
    for values, expected, rounding in zip(
        shown,
        (
            response.bandwidth,
            response.peak_db,
            response.peak_omega,
            response.crossover,
            response.phase_margin,
            response.modulus_margin,
        ),
        (0.0051, 0.0051, 0.0051, 0.0051, 0.051, 0.00051),
        strict=True,
    ):
        np.testing.assert_allclose(values, expected, atol=rounding)
    assert [row[7] for row in rows] == ["yes"] * 4


def test_bode_of_an_axis_has_the_margin_of_its_damping(good, desk):
    """P in the feedback path: zeta 0.95 to 0.99 at 33 rad/s."""
    (_, *rows), *_ = tables(good("bode", "../given/axis.yaml").out)
    zeta, omega_n = np.array([0.95, 0.98, 0.99, 0.95]), 65.991 / 2
    crossover = omega_n * np.sqrt(2 * zeta**2 + np.sqrt(4 * zeta**4 + 1))
    margin = np.degrees(np.arctan(2 * zeta * crossover / omega_n))
    a = 1 - 2 * zeta**2
    width = omega_n * np.sqrt(a + np.sqrt(a**2 + 1))

    for column, expected in ((1, width), (4, crossover), (5, margin)):
        shown = [float(row[column]) for row in rows]
        np.testing.assert_allclose(shown, expected, atol=0.051)


def test_bode_writes_the_responses(good, desk):
    good("bode", "../given/coupled.yaml", "--out", "b.csv")
    header, *rows = read_csv(desk / "b.csv")
    groups = ("tracking_size", "tracking_phase", "loop_gain_size", "loop_gain_phase")

    assert header == ["omega", *(f"{name}_{k}" for name in groups for k in (1, 2, 3, 4))]
    assert np.all(np.isfinite(np.array(rows, dtype=float))) and len(rows) == 4000


def test_bode_where_the_motion_ends(good, desk):
    good("bode", "../given/axis.yaml", "--time", "1.25")
    good("bode", "../given/axis.yaml", "--time", "0")


@pytest.mark.parametrize("time", ["1.26", "-0.1", "nan", "inf", "1e300"])
def test_bode_refuses_a_time_outside_of_the_motion(call, desk, time):
    refused(call("bode", "../given/axis.yaml", f"--time={time}", "--out", "x.png"), "--time")
    assert list(desk.iterdir()) == []


def test_bode_with_anti_windup(good, desk):
    text = SCENARIO.replace("kind: pi,", "kind: pi, anti_windup: true,")
    (desk.parent / "given" / "careful.yaml").write_text(text)
    plain = good("bode", "../given/axis.yaml").out
    assert good("bode", "../given/careful.yaml").out == plain.replace("axis:", "careful:")


def test_bode_says_that_friction_does_not_count(good, desk):
    text = SCENARIO.replace("kind: axis", "kind: axis, friction: {viscous: [1, 1, 1, 1]}")
    (desk.parent / "given" / "rough.yaml").write_text(text)
    assert "note: friction" in good("bode", "../given/rough.yaml").out
    assert "note" not in good("bode", "../given/axis.yaml").out


def test_bode_says_what_is_unstable(good, desk):
    elasticity = "elasticity: {natural_frequency: [65.991, 0, 0, 0], encoder: link}"
    text = SCENARIO.replace("kind: axis", f"kind: axis, {elasticity}")
    (desk.parent / "given" / "soft.yaml").write_text(text)
    done = good("bode", "../given/soft.yaml")

    (_, *rows), *_ = tables(done.out)
    assert rows[0][7] == "no"
    assert "note: the margins of an unstable loop say nothing" in done.out


def test_bode_shows_a_dash_where_there_is_none(good, desk):
    text = ENDS["coupled"].replace("kind: pi,", "kind: inverse_dynamics,")
    (desk.parent / "given" / "id.yaml").write_text(text)
    (_, *rows), *_ = tables(good("bode", "../given/id.yaml", "--time", "0").out)
    assert [row[1] for row in rows] == ["–"] * 4


# --- stability ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def shipped(tmp_path_factory):
    """What `stability` prints for the shipped device, by place of the encoder and drive."""
    import contextlib
    import io

    from sdt_drake.cli import main

    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(["stability", "package://sdt/scenarios/real_device.yaml"]) == 0
    titles = re.findall(r"^encoder on the (\w+), (.*): damping", out.getvalue(), re.M)
    return dict(zip(titles, tables(out.getvalue()), strict=True))


def test_stability_shows_both_encoders_and_both_drives(shipped):
    drives = ("ideal drive", "the scenario's drive")
    assert list(shipped) == [(e, d) for e in ("motor", "link") for d in drives]
    for header, *rows in shipped.values():
        assert header == ["joint", "0.1", "0.25", "0.5", "0.75", "1", "1.5", "unstable from"]
        assert [row[0] for row in rows] == JOINTS


def test_stability_prints_the_findings(shipped):
    _, *rows = shipped["motor", "ideal drive"]
    for row in rows:
        half, one = (
            [float(x) for x in re.fullmatch(r"(.*), (.*) %", row[i]).groups()] for i in (3, 5)
        )
        assert half[0] > 0.5 and half[1] == 0
        assert one == pytest.approx([0.2, 25], rel=0.15)
        assert row[7] == "–"
    _, *rows = shipped["link", "ideal drive"]
    assert [row[7] for row in rows[2:]] == ["–", "–"]
    assert [float(row[7]) for row in rows[:2]] == pytest.approx([0.35, 0.59], abs=0.01)
    _, *rows = shipped["motor", "the scenario's drive"]
    assert [row[1] == "unstable" for row in rows] == [False, False, True, True]


def test_stability_without_a_drive_shows_the_ideal_one_only(good, desk):
    out = good("stability", "../given/axis.yaml").out
    assert out.count("ideal drive") == 2 and "scenario's drive" not in out


def test_stability_damping_moves_the_border(good, desk):
    def border(*options):
        return float(tables(good("stability", "../given/axis.yaml", *options).out)[1][1][7])

    assert border("--damping", "0.02") > border() + 0.01
    assert border("--omega-r", "20") == pytest.approx(0.35, abs=0.05)
    springs = "{kind: axis, elasticity: {natural_frequency: [9, 9, 9, 9], damping_ratio: 0.02}}"
    text = SCENARIO.replace("{kind: axis}", springs)
    (desk.parent / "given" / "springs.yaml").write_text(text, encoding="utf-8")
    sprung = good("stability", "../given/springs.yaml").out
    assert float(tables(sprung)[1][1][7]) == border("--damping", "0.02")
    assert "damping ratio 0.02" in sprung and "whatever plant.elasticity says" in sprung


def test_stability_takes_the_scenarios_own_frequency_and_says_so(good, desk):
    text = SCENARIO.replace("65.991", "30")
    (desk.parent / "given" / "soft.yaml").write_text(text, encoding="utf-8")
    own = good("stability", "../given/soft.yaml").out
    told = good("stability", "../given/soft.yaml", "--omega-r", "30").out
    published = good("stability", "../given/soft.yaml", "--omega-r", "65.991").out

    assert "omega_r = 30 rad/s (controller.omega_r)" in own
    assert "omega_r = 30 rad/s (--omega-r)" in told
    assert tables(own) == tables(told)
    assert "own gains there: 0.500 0.500 0.500 0.500" in own
    assert "own gains there: 0.227 0.227 0.227 0.227" in published


def test_stability_scales_the_frequency_for_the_device(good, desk):
    text = SCENARIO + "device: {structure_scale: 0.8}\n"
    (desk.parent / "given" / "lighter.yaml").write_text(text, encoding="utf-8")
    out = good("stability", "../given/lighter.yaml").out
    omega_r, factor = re.search(
        r"omega_r = (\S+) rad/s \(controller.omega_r, 65.991, times (\S+) for the device\)", out
    ).groups()
    assert float(omega_r) == pytest.approx(65.991 * float(factor), rel=1e-3) != 65.991
    assert "own gains there: 0.500 0.500 0.500 0.500" in out


def test_stability_of_given_gains_needs_a_frequency(call, good, desk):
    gains = "controller: {kind: pi, kp: [267, 6340, 52000, 15700], ki: [4640, 1e5, 8.7e5, 2.7e5]}\n"
    text = SCENARIO.replace(f"{CONTROLLER}}}\n", gains)
    (desk.parent / "given" / "gains.yaml").write_text(text, encoding="utf-8")
    refused(call("stability", "../given/gains.yaml", "--out", "x.png"), "--omega-r: missing", "kp")
    assert list(desk.iterdir()) == []
    assert "(--omega-r)" in good("stability", "../given/gains.yaml", "--omega-r", "60").out


def test_stability_says_whose_loops_it_sweeps(good, desk):
    """Every controller has a report of its own: its loop, and what has no meaning for it."""
    said = {
        "pi": ["pi, PI speed loops with structure p_in_feedback"],
        "pi_ctc": ["pi_ctc, ", "feedforward", "is left out"],
        "pi_id": ["structure pi\n", ", 37 %", "feedforward"],
        "p_pi": ["structure pi in position loops, K_V = omega_n / 4", "position, sampled"],
        "pi_scheduled": ["their gains those at the largest inertia"],
        "inverse_dynamics": ["whole state every 0.005 s", "needs the coupled plant"],
    }
    assert said.keys() == CONTROLLERS.keys()
    outs = []
    for kind, parts in said.items():
        text = ENDS["coupled"].replace("kind: pi,", f"kind: {kind},")
        (desk.parent / "given" / "c.yaml").write_text(text, encoding="utf-8")
        outs.append(good("stability", "../given/c.yaml").out)
        for part in parts:
            assert part in outs[-1], kind
    assert len(set(outs)) == len(said)


def test_stability_says_a_position_gain_of_its_own(good, desk):
    text = SCENARIO.replace("kind: pi,", "kind: p_pi, position_gain: [3, 4, 5, 6],")
    (desk.parent / "given" / "k_v.yaml").write_text(text, encoding="utf-8")
    assert "K_V = [3.0, 4.0, 5.0, 6.0] 1/s" in good("stability", "../given/k_v.yaml").out


@pytest.mark.parametrize("value", ["0", "-1", "0.05", "nan", "inf", "soft", "1e9"])
def test_stability_refuses_an_omega_r(call, desk, value):
    done = call("stability", "../given/axis.yaml", f"--omega-r={value}", "--out", "x.png")
    refused(done, "--omega-r")
    assert list(desk.iterdir()) == []


def test_stability_of_a_slow_structure_and_a_fast_drive_ends(good, desk):
    """20 / omega_n are 16 million periods of the drive."""
    text = SCENARIO + "drive: {period: 0.000125}\n"
    (desk.parent / "given" / "fast.yaml").write_text(text, encoding="utf-8")
    shown = good("stability", "../given/fast.yaml", "--omega-r", "0.1").out
    slow, fast = tables(shown)[:2]
    for one, other in zip(slow[1:], fast[1:], strict=True):
        for cell, same in zip(one[1:7], other[1:7], strict=True):
            pairs = [[float(x) for x in re.findall(r"[\d.]+", text)] for text in (cell, same)]
            np.testing.assert_allclose(pairs[0], pairs[1], atol=1)


@pytest.mark.parametrize("value", ["-0.1", "nan", "inf"])
def test_stability_refuses_a_damping(call, desk, value):
    done = call("stability", "../given/axis.yaml", f"--damping={value}", "--out", "x.png")
    refused(done, "--damping")
    assert list(desk.iterdir()) == []


def test_stability_of_a_robot_without_rotors(call, desk):
    given = desk.parent / "given"
    sdf = re.sub(r"<drake:rotor_inertia>.*?</drake:rotor_inertia>", "", test_cli.SDF)
    (given / "light.sdf").write_text(sdf, encoding="utf-8")
    (given / "light.yaml").write_text("robot: light.sdf\n" + SCENARIO)
    refused(call("stability", "../given/light.yaml"), "rotor inertia 0", "joint 1")
