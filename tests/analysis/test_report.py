"""The paper recomputed: its numbers, its files, and its report."""

import dataclasses
import html
import json
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import sdt_drake
from sdt_drake import paper
from sdt_drake.analysis import plots
from sdt_drake.analysis.block_diagrams import DIAGRAMS
from sdt_drake.analysis.claims import Claims
from sdt_drake.analysis.files import summary, write_reproduction
from sdt_drake.analysis.report import write_report
from sdt_drake.analysis.reproduction import Stopwatch
from sdt_drake.errors import InputError
from sdt_drake.graphviz import has_graphviz
from sdt_drake.motion import Motion
from sdt_drake.pilot import felt_difference
from sdt_drake.resources import page_text
from sdt_drake.tables import read_table

GEAR = np.array([67.2, 1, 1, 1])  # published
ROTOR = np.array([0.1291, 1.73, 0.531, 0.531])  # published
OMEGA_R = 2 * np.pi * 10.5028
ZETA = np.array([0.95, 0.98, 0.99, 0.95])

# By an independent calculation.
I_EFF = {
    "i_eff_max": (4.2601, 98.0127, 796.298, 250.280),
    "i_eff_median": (4.004, 77.61, 792.10, 250.28),
    "i_eff_min": (3.830, 66.82, 774.84, 250.28),
}
# plant, process, algorithm, controller, disturbed: largest |speed error| of joints 1 to 4.
LARGEST = {
    ("axis", "i_eff_max", "printed", "pi", False): (0.0272, 0.8688, 0.0145, 0.0546),
    ("axis", "i_eff_max", "printed", "pi_ctc", True): (0.0271, 0.1939, 0.0099, 0.0505),
    ("axis", "i_eff_min", "printed", "pi", False): (0.0272, 0.9001, 0.0147, 0.0526),
    ("axis", "i_eff_min", "printed", "pi_ctc", True): (0.0271, 0.1938, 0.0099, 0.0505),
    ("axis", "i_eff_max", "consistent", "pi", False): (0.0272, 0.2100, 0.0151, 0.0529),
    ("axis", "i_eff_max", "consistent", "pi_ctc", True): (0.0271, 0.1939, 0.0099, 0.0505),
    ("coupled", "multibody", "consistent", "pi", False): (0.0273, 0.2085, 0.0130, 0.0539),
    ("coupled", "multibody", "consistent", "pi_ctc", False): (0.0273, 0.1865, 0.0112, 0.0523),
    ("coupled", "multibody", "printed", "pi_ctc", False): (0.0275, 0.9153, 0.0240, 0.0779),
}
# Of the coupled runs: RMS, and drift of the position [deg].
RMS_AND_DRIFT = {
    ("consistent", "pi"): ((0.01606, 0.06119, 0.00660, 0.02045), (8.3, 7.1, 0.5, 0.8)),
    ("consistent", "pi_ctc"): ((0.01606, 0.05625, 0.00663, 0.02029), (8.3, 5.5, 0.5, 0.7)),
    ("printed", "pi_ctc"): ((0.01607, 0.09215, 0.00685, 0.02060), (8.3, 8.9, 0.5, 0.8)),
}
# Run and largest |speed error| of joint 2 at 11 s < t < 16.5 s, by file.
FILES = {
    "axis_pi": (("axis", "i_eff_max", "printed", "pi", False), 0.0470),
    "axis_pi_ctc": (("axis", "i_eff_max", "printed", "pi_ctc", True), 0.0090),
    "coupled_pi": (("coupled", "multibody", "consistent", "pi", False), 0.0486),
    "coupled_pi_ctc": (("coupled", "multibody", "consistent", "pi_ctc", False), 0.0052),
}
RUN_COLUMNS = (
    "v_ref v tau_cmd tau load_torque speed_error q_ref q tau_limited tau_peak tau_rms saturated "
    "beyond_stop"
)
REFERENCE_COLUMNS = (
    "q_ref v_ref vd_ref tau_inertial tau_reaction tau_velocity tau_gravity tau_coupled "
    "load_torque alleviating_torque i_eff"
)
# Captions by file, and block diagrams, as the report's text has them.
PICTURES = re.findall(r"!\[(.*)\]\((.*)\.svg\)", page_text("report.md"))
FIGURES = {name: caption for caption, name in PICTURES if "/" not in name}
DRAWN = [name.removeprefix("diagrams/") for _, name in PICTURES if "/" in name]


@pytest.fixture(scope="module")
def content(reproduced):
    """summary.json, by a strict reader."""

    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    text = (reproduced / "summary.json").read_text(encoding="utf-8")
    return json.loads(text, parse_constant=refuse)


@pytest.fixture(scope="module")
def report(reproduced):
    return (reproduced / "report.md").read_text(encoding="utf-8")


def entry_of(content, key):
    """The entry of a run."""
    *names, disturbed = key
    (entry,) = [
        entry
        for entry in content["tracking"]
        if [entry[name] for name in ("plant", "process", "algorithm", "controller")] == names
        and (entry["disturbance_amplitude"] > 0) == disturbed
    ]
    return entry


# --- summary.json ----------------------------------------------------------------------------


def test_keys_of_the_summary(content):
    assert list(content) == [
        "table1", "step_response", "tracking", "claims", "beyond", "pi_or_pi_ctc", "versions",
        "wall_time_s",
    ]  # fmt: skip
    assert content["versions"]["package"] == sdt_drake.__version__
    assert set(content["versions"]) == {"package", "drake", "numpy", "python"}
    assert len(content["wall_time_s"]) >= 5
    # Joint 3 swings: it has no constant speed, and JSON has no NaN.
    for entry in content["tracking"]:
        assert [value is None for value in entry["constant_speed_error"]] == [0, 0, 1, 0]
    keys = {(e["plant"], e["process"], e["algorithm"]) for e in content["tracking"]}
    assert len(keys) == 6 and len(content["tracking"]) == 13


def test_a_number_that_does_not_exist_is_null(reproduction):
    step = reproduction.steps["pi"]
    never = dataclasses.replace(step.metrics, settling_time=math.nan, overshoot_percent=math.inf)
    steps = reproduction.steps | {"pi": dataclasses.replace(step, metrics=never)}
    text = json.dumps(summary(dataclasses.replace(reproduction, steps=steps), []), allow_nan=False)
    pi = json.loads(text)["step_response"]["pi"]
    assert pi["settling_time"] is None and pi["overshoot_percent"] is None


def test_table1(content):
    columns = {key: [row[key] for row in content["table1"]] for key in content["table1"][0]}
    for name, expected in I_EFF.items():
        np.testing.assert_allclose(columns[name], expected, rtol=2e-4, err_msg=name)
        # K_PS and K_IS are fixed, so zeta goes with 1 / sqrt(I_eff).
        zeta = ZETA / np.sqrt(np.divide(expected, I_EFF["i_eff_max"]))
        np.testing.assert_allclose(columns[name.replace("i_eff", "zeta")], zeta, rtol=2e-4)
    np.testing.assert_allclose(columns["variation_percent"], (10.09, 31.82, 2.69, 0), atol=0.006)
    i_eff = np.array(columns["i_eff_max"])
    np.testing.assert_allclose(columns["ki"], 0.25 * OMEGA_R**2 * i_eff, rtol=1e-4)
    # 2 zeta sqrt(I K_IS) = zeta omega_r I
    np.testing.assert_allclose(columns["kp"], ZETA * OMEGA_R * i_eff, rtol=1e-4)


def test_published_side(content):
    published = [row["published"] for row in content["table1"]]
    for name, expected in {
        "i_eff_max": [4.26, 98.01, 796.3, 250.28],
        "variation_percent": [39.95, 31.82, 7.29, 25.4],
        "kp": [267.1, 6340, 52000, 15700],
        "ki": [4640, 107000, 867000, 273000],
        "zeta_max": list(ZETA),
        "zeta_median": [1.06, 1.07, 1.009, 1.017],
        "zeta_min": [1.23, 1.18, 1.03, 1.099],
        "i_eff_min": [None] * 4,
    }.items():
        assert [row[name] for row in published] == expected
    assert content["step_response"]["published"] == {
        "pi": {"rise_time": 0.022, "settling_time": 0.16, "overshoot_percent": 13.53},
        "p_in_feedback": {"rise_time": 0.094, "settling_time": 0.159, "overshoot_percent": 0.0},
    }
    assert paper.JOINT2_PI_MAX_ERROR == {"i_eff_max": 1.08, "i_eff_min": 1.204}


@pytest.mark.parametrize("structure", ["pi", "p_in_feedback"])
def test_step_responses_are_those_of_the_linear_loop(content, structure):
    omega_n, t = OMEGA_R / 2, np.linspace(0, 0.5, 500_001)
    if structure == "pi":  # zeta 1
        y = 1 + (omega_n * t - 1) * np.exp(-omega_n * t)
    else:
        zeta = 0.95
        omega_d = omega_n * np.sqrt(1 - zeta**2)
        swing = np.cos(omega_d * t) + zeta / np.sqrt(1 - zeta**2) * np.sin(omega_d * t)
        y = 1 - np.exp(-zeta * omega_n * t) * swing
    computed = content["step_response"][structure]
    assert computed == pytest.approx(
        {
            "rise_time": t[np.argmax(y >= 0.9)] - t[np.argmax(y >= 0.1)],
            "settling_time": t[np.flatnonzero(np.abs(y - 1) > 0.02)[-1]],
            "overshoot_percent": 100 * (y.max() - 1),
        },
        rel=0.01,
    )


@pytest.mark.parametrize("key", LARGEST, ids=str)
def test_largest_errors(content, key):
    entry = entry_of(content, key)
    tolerance = 0.02 if key[0] == "axis" else 0.05
    np.testing.assert_allclose(entry["max_abs_speed_error"], LARGEST[key], rtol=tolerance)
    if key[0] == "coupled":
        rms, drift = RMS_AND_DRIFT[key[2:4]]
        np.testing.assert_allclose(entry["rms_speed_error"], rms, rtol=0.05)
        np.testing.assert_allclose(np.degrees(entry["max_abs_position_error"]), drift, atol=0.06)


def test_the_smallest_inertia_is_the_published_one_less_its_variation(reproduction):
    for controller, sign in (("pi", "printed"), ("pi_ctc", "consistent")):
        design = reproduction.axis(controller, sign, "i_eff_min").design
        expected = [4.26 * 0.6005, 98.01 * 0.6818, 796.3 * 0.9271, 250.28 * 0.746]
        np.testing.assert_allclose(design.i_eff, expected, rtol=1e-12)


def test_what_is_felt_with_every_controller(reproduction, content):
    for entry, compared in zip(content["beyond"], reproduction.beyond, strict=True):
        felt, head = entry["felt"], compared.head
        assert felt["share"] == head.felt.share
        assert felt["share_from_angles"] == head.felt_from_angles.share
        assert felt["channels"] == ["roll", "pitch", "yaw", "fore-aft", "lateral", "vertical"]
        np.testing.assert_array_equal(felt["largest"], head.felt.multiples.max(axis=0))
        np.testing.assert_array_equal(felt["channel_share"], (head.felt.multiples > 1).mean(axis=0))
        assert (entry["rms_share"], entry["peak_share"]) == (
            compared.motors.rms_share.tolist(), compared.motors.peak_share.tolist(),
        )  # fmt: skip
    by_label = {c.label: c.head for c in reproduction.beyond}
    apart = felt_difference(by_label["pi"].achieved, by_label["pi_ctc"].achieved, 0.005)
    assert content["pi_or_pi_ctc"]["share"] == pytest.approx(apart.share)


def test_what_the_report_says_of_the_pilot_holds(content):
    """Its sentences stand in a file: the numbers must agree with their words."""
    share = {e["controller"]: e["felt"]["share"] for e in content["beyond"]}
    angles = {e["controller"]: e["felt"]["share_from_angles"] for e in content["beyond"]}
    assert content["pi_or_pi_ctc"]["share"] > 0.5
    assert 0 <= share["pi"] - share["pi_ctc"] < 0.1 < 0.8 < share["pi_ctc"]
    assert min(angles["pi"], angles["pi_ctc"]) > 0.5 * share["pi_ctc"]
    assert share["p_pi"] == pytest.approx(0.309, abs=0.005)
    assert share["p_pi"] > 3 * share["p_pi+ctc"] > 9 * share["p_pi+id"] > 0
    assert share["inverse_dynamics"] == 0


def test_findings_show_these_numbers(content):
    text = (Path(__file__).parents[2] / "diagrams/README.md").read_text(encoding="utf-8")
    lines = [line.split("|") for line in text.splitlines() if line.count("|") == 4]
    rows = {line[1].strip(): line[3] for line in lines}
    axis, coupled = (
        [entry_of(content, FILES[f"{plant}_{name}"][0]) for name in ("pi", "pi_ctc")]
        for plant in ("axis", "coupled")
    )
    both = "largest speed error: PI, PI + CTC"
    for label, entries, name, joint in (
        (f"decoupled axes, joint 2, {both}", axis, "max_abs_speed_error", 2),
        (f"**coupled plant**, joint 2, {both}", coupled, "max_abs_speed_error", 2),
        ("coupled plant, joint 2 at constant speed, largest", coupled, "constant_speed_error", 2),
        ("coupled plant, joint 4 at constant speed, largest", coupled, "constant_speed_error", 4),
    ):
        shown = [float(number) for number in re.findall(r"[\d.]+(?=[, ])", rows[label])]
        assert shown == [float(f"{entry[name][joint - 1]:.3g}") for entry in entries], label


# --- CSV files -------------------------------------------------------------------------------


def check_header(path, names):
    first = path.read_text(encoding="utf-8").partition("\n")[0].split(",")
    assert first == ["time", *(f"{name}_{k}" for name in names.split() for k in range(1, 5))]


@pytest.mark.parametrize("name", FILES)
def test_recordings(reproduced, content, name):
    path, (key, middle_error) = reproduced / f"{name}.csv", FILES[name]
    check_header(path, RUN_COLUMNS)
    time, columns = read_table(path)
    np.testing.assert_allclose(time, 0.005 * np.arange(6001), atol=1e-12)
    error = columns["v"] - columns["v_ref"]
    np.testing.assert_array_equal(columns["speed_error"], error)
    middle = (time > 11) & (time < 16.5)
    assert np.abs(error[middle, 1]).max() == pytest.approx(middle_error, rel=0.02)
    entry = entry_of(content, key)
    np.testing.assert_allclose(np.abs(error).max(axis=0), entry["max_abs_speed_error"])
    saturated = columns["saturated"][1:].mean(axis=0)
    np.testing.assert_allclose(saturated, entry["saturated_fraction"], atol=1e-12)


def test_reference_groups_add_up(reproduced, reproduction):
    path = reproduced / "reference.csv"
    check_header(path, REFERENCE_COLUMNS)
    _, columns = read_table(path)
    for name in ("inertial", "reaction", "velocity", "gravity"):
        expected = getattr(reproduction.design.torques, name)
        np.testing.assert_allclose(columns[f"tau_{name}"], expected, atol=1e-9)
    groups = sum(columns[f"tau_{name}"] for name in ("reaction", "velocity", "gravity"))
    np.testing.assert_allclose(columns["tau_coupled"], groups, atol=1e-8)
    largest = np.abs(columns["tau_coupled"]).max(axis=0)
    np.testing.assert_allclose(largest, [4031, 3419, 678, 288], atol=0.6)
    split = GEAR * (columns["load_torque"] - columns["alleviating_torque"])
    np.testing.assert_allclose(columns["tau_coupled"], split, atol=1e-8)
    # Help points along the acceleration, and is never more than the joint itself needs.
    help_ = GEAR * columns["alleviating_torque"] * np.sign(columns["vd_ref"])
    assert np.all(help_ >= -1e-9) and np.all(help_ <= np.abs(columns["tau_inertial"]) + 1e-9)
    d_kk = GEAR**2 * (columns["i_eff"] - ROTOR)
    np.testing.assert_allclose(columns["tau_inertial"], d_kk * columns["vd_ref"], atol=1e-6)
    motion = Motion.from_csv(path)
    np.testing.assert_array_equal(motion.q, reproduction.design.motion.q)
    np.testing.assert_allclose(np.degrees(motion.q[:, 2].min()), -9.9, atol=0.05)


# --- files and report ------------------------------------------------------------------------


def test_all_files_are_there_and_what_their_suffix_says(reproduced):
    folder = reproduced
    files = {str(path.relative_to(folder)): path for path in folder.rglob("*") if path.is_file()}
    expected = {"summary.json", "reference.csv", "table1.md", "report.md", "report.html"}
    expected |= {"device.html"} | {f"{name}.csv" for name in FILES}
    expected |= {f"{name}.{suffix}" for name in FIGURES for suffix in ("png", "svg")}
    drawn = ("dot", "svg") if has_graphviz() else ("dot",)
    assert list(DIAGRAMS) == DRAWN
    assert set(files) == expected | {f"diagrams/{n}.{s}" for n in DIAGRAMS for s in drawn}
    for name, path in files.items():
        start = {".png": b"\x89PNG\r\n", ".dot": b"digraph", ".svg": b"<"}.get(path.suffix, b"")
        assert path.read_bytes().startswith(start), name


def test_report_has_every_claim_run_version_and_the_provenance(report, content):
    rows = {line.split(" | ")[0].lstrip("| "): line for line in report.splitlines()}
    for claim in content["claims"]:
        row = rows[claim["id"]]
        assert f"**{claim['verdict']}**" in row and claim["why"] in row
    verdicts = [claim["verdict"] for claim in content["claims"]]
    for verdict in set(verdicts):
        assert f"**{verdicts.count(verdict)}** {verdict}" in report
    for entry in content["tracking"]:
        assert " ".join(f"{value:.4f}" for value in entry["max_abs_speed_error"]) in report
    for version in content["versions"].values():
        assert version in report
    assert "calibrated" in report and "assumed" in report
    assert not re.search(r"\b(nan|inf|None)\b", report)
    for block in re.findall(r"(?:^\|.*\n)+", report, re.MULTILINE):
        assert len({line.count("|") for line in block.splitlines()}) == 1, block[:200]
    headings = re.findall(r"^## (.*)$", report, re.MULTILINE)
    assert headings[:5] == ["Summary", "Device in 3D", "Claims", "Motion", "Table 1"]
    answer, figure = report.split("## Summary\n\n")[1].split("\n\n")[:2]
    assert "constant speed" in answer and "(coupled_errors.png)" in figure


def test_links_of_the_report_lead_somewhere(report, reproduced):
    links = re.findall(r"\]\(([^)]+)\)", report)
    assert {"figure2.png", "figure4.png", "figure7.png", "figure8.png"} <= set(links)
    for link in links:
        assert (reproduced / link).is_file(), link


def test_sentences_say_what_the_runs_say(report, content):
    pi, ctc, printed = (
        entry_of(content, ("coupled", "multibody", sign, controller, False))
        for sign, controller in RMS_AND_DRIFT
    )
    before, after = pi["max_abs_speed_error"][1], ctc["max_abs_speed_error"][1]
    assert f"joint 2 from {before:.3f} to {after:.3f} rad/s**, {before / after:.2f} times" in report
    steady = pi["constant_speed_error"][1] / ctc["constant_speed_error"][1]
    assert f"at constant speed {steady:.1f} times less" in report
    assert f"{printed['max_abs_speed_error'][1] / before:.1f} times that of PI alone" in report
    of = {entry["controller"]: entry for entry in content["beyond"]}
    drift = math.degrees(max(of["pi"]["max_abs_position_error"]))
    kept = math.degrees(max(of["p_pi+id"]["max_abs_position_error"]))
    assert f"drifts by up to {drift:.1f} deg" in report and f"within {kept:.3f} deg" in report
    gains = np.divide(of["pi"]["rms_speed_error"], of["pi_id"]["rms_speed_error"])
    assert f"{gains.min():.0f} to {gains.max():.0f} times less RMS speed error" in report
    for label in ("pi", "pi_ctc", "p_pi", "p_pi+ctc", "p_pi+id"):
        assert f"{100 * of[label]['felt']['share']:.1f} %" in report
    for label in ("pi", "pi_ctc"):
        assert f"{100 * of[label]['felt']['share_from_angles']:.1f}" in report
    rotation, force = (max(content["pi_or_pi_ctc"]["largest"][k : k + 3]) for k in (0, 3))
    assert f"{rotation:.2f} (yaw) and {force:.2f} (lateral) times" in report


def test_table1_markdown(reproduced):
    text = (reproduced / "table1.md").read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    computed = [row for row in rows if row[0].startswith("joint ")]
    assert [float(row[1]) for row in computed] == pytest.approx(I_EFF["i_eff_max"], abs=0.006)
    assert [float(row[7]) for row in computed] == pytest.approx(ZETA)
    published = [row for row in rows if row[0] == "*published*"]
    assert [row[5] for row in published] == ["267.1", "6340", "52000", "15700"]
    assert [row[6] for row in published] == ["4640", "107000", "867000", "273000"]
    assert "calibrated" in text


def test_values_of_claims_stand_in_a_table():
    text = "K_PS = omega_r² I_eff,max"
    claim = {"id": "a", "statement": text, "published": [4640.0, None], "computed": [4.5e-13, True],
             "verdict": "reproduced", "why": "so"}  # fmt: skip
    assert "| 4640, – | 4.5e-13, yes | **reproduced** |" in Claims([claim], 2).markdown()
    page = Claims([claim], 2).html(str)
    assert "joint 2" in page and "<td>4640</td><td>–</td>" in page and ">all 1<" in page
    one = Claims([claim | {"published": 0.5, "computed": [250.28, 52016.4]}], 2).html(str)
    assert '<td class="whole" colspan="2">0.5</td>' in one  # of no joint alone
    assert "<td>250.28</td><td>52016</td>" in one
    both = Claims([claim | {"published": {"a_b": 1}, "computed": {"a_b": 2.0}}], 2).html(str)
    assert 'scope="col">a b</th>' in both and "<td>2</td>" in both


# --- existing folders, and runs that fail ----------------------------------------------------


@pytest.fixture
def folder(reproduced, tmp_path):
    """A copy of what the report needs."""
    ignored = shutil.ignore_patterns("*.csv", "*.png")
    return Path(shutil.copytree(reproduced, tmp_path / "out", ignore=ignored))


def contents(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture
def quick(monkeypatch):
    """Figures and recording cost most of the time: write few bytes instead."""
    svg = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
    monkeypatch.setattr(Figure, "savefig", lambda self, path, **options: path.write(svg))
    write = "sdt_drake.analysis.files.record_html"
    monkeypatch.setattr(write, lambda robot, time, q, path, **options: path.write_text("3D"))


def test_files_are_replaced_foreign_ones_left_and_no_graphviz_is_told(
    reproduction, reproduced, tmp_path, quick, without_graphviz
):
    used = tmp_path / "used"
    (used / "diagrams").mkdir(parents=True)
    for name in ("notes.txt", "diagrams/mine.dot", "report.md"):
        (used / name).write_text("old")
    write_reproduction(reproduction, used, Stopwatch(lambda line: None))

    after, fresh = contents(used), contents(reproduced)
    assert after.pop("notes.txt") == after.pop("diagrams/mine.dot") == b"old"
    assert set(after) == {name for name in fresh if not re.match(r"diagrams/.*svg", name)}
    for name in fresh:  # the same study gives the same bytes
        if name.endswith((".csv", ".dot")):
            assert after[name] == fresh[name], name
    report = after["report.md"].decode()
    for name in DIAGRAMS:
        assert re.search(rf"`diagrams/{name}\.dot`; no \.svg: .*Graphviz", report)
    for link in re.findall(r"\]\(([^)]+)\)", report):
        assert (used / link).is_file(), link


def test_a_figure_that_cannot_be_made_leaves_the_old_results(reproduction, tmp_path, monkeypatch):
    for name in ("report.md", "summary.json", "figure2.png"):
        (tmp_path / name).write_text("old")

    def broken(*args, **kwargs):
        raise RuntimeError("no figure today")

    monkeypatch.setattr(plots, "speed_errors", broken)
    with pytest.raises(RuntimeError, match="no figure today"):
        write_reproduction(reproduction, tmp_path, Stopwatch(lambda line: None))
    after = contents(tmp_path)
    assert {after.pop(name) for name in ("report.md", "summary.json", "figure2.png")} == {b"old"}
    assert set(after) == {"reference.csv", *(f"{name}.csv" for name in FILES)}


def test_stages_are_told_as_they_pass():
    told = []
    watch = Stopwatch(told.append)
    for name in ("one", "two", "one"):
        with watch.stage(name):
            pass
    assert list(watch.seconds) == ["one", "two"] and len(told) == 3
    assert all(re.fullmatch(r"  (one|two) +\d+\.\d\d s", line) for line in told)


def change(folder, edit):
    path = folder / "summary.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    edit(content)
    path.write_text(json.dumps(content), encoding="utf-8")


def test_other_pictures_come_last_unless_they_are_none(folder):
    shutil.copy(folder / "figure4.svg", folder / "felt_<motion>.svg")
    (folder / "cut.svg").write_text("<svg", encoding="utf-8")
    told = []
    page = write_report(folder, told.append).read_text(encoding="utf-8")
    alts = list(map(html.unescape, re.findall(r'<img alt="([^"]*)"', page)))
    assert alts[:1] == [FIGURES["coupled_errors"]] and alts[-1] == "Felt <motion>."
    assert set(FIGURES.values()) <= set(alts)
    assert told == [f"{folder / 'cut.svg'}: is not an SVG picture, left out"]


def test_no_text_of_the_summary_becomes_a_tag(folder):
    evil = '<script>alert(1)</script>" onload="x'

    def edit(summary):
        summary["claims"][0] |= {"why": evil, "statement": evil, "id": evil, "published": evil}
        summary["versions"]["drake"] = evil
        summary["wall_time_s"] = {evil: 1.0}
        summary["beyond"][6] |= {"controller": evil, "needs": [evil], "blocks": evil}
        summary["beyond"][0]["felt"]["channels"][0] = evil
        summary["tracking"][0] |= {"controller": evil, "plant": evil, "algorithm": evil}

    change(folder, edit)
    page = write_report(folder).read_text(encoding="utf-8")
    assert "alert(1)</script>" not in page and '" onload' not in page
    assert page.count("alert(1)") >= 10


def _remove(name):
    return lambda folder: (folder / name).unlink()


def _write(name, content):
    return lambda folder: (folder / name).write_bytes(content)


BROKEN = {
    "no summary": (_remove("summary.json"), "summary.json: is missing"),
    "cut summary": (_write("summary.json", b'{"a": '), "summary.json: is not JSON"),
    "not a number": (_write("summary.json", b'{"x": NaN}'), "holds NaN, expected finite"),
    "no claims": (lambda f: change(f, lambda s: s.pop("claims")), "has no 'claims'"),
    "odd verdict": (
        lambda f: change(f, lambda s: s["claims"][0].update(verdict="so so")), "'so so'"),
    "no runs": (lambda f: change(f, lambda s: s.update(tracking=[])), "it is of another version"),
    "no figure": (_remove("figure8.svg"), "figure8.svg: is missing"),
    "cut figure": (_write("figure2.svg", b"<svg"), "figure2.svg: is not an SVG"),
    "binary": (_write("figure4.svg", b"\xff\xfe\x00"), "figure4.svg: cannot be read"),
    "no diagram": (lambda f: shutil.rmtree(f / "diagrams"), "figure3.svg: is missing"),
    "recording": (_write("device.html", b"\xff"), "device.html: cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_missing_is_named_and_the_old_report_stays(folder, case):
    spoil, expected = BROKEN[case]
    spoil(folder)
    before = contents(folder)
    with pytest.raises(InputError) as caught:
        write_report(folder)
    message = str(caught.value)
    assert expected in message and f"sdt-drake reproduce --out {folder}" in message
    assert "\n" not in message and contents(folder) == before
