"""The files of a study: what is in them, and how they get there."""

import dataclasses
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import sdt_drake
from sdt_drake.analysis import plots
from sdt_drake.analysis.block_diagrams import DIAGRAMS
from sdt_drake.analysis.report import report_markdown, summary, write_study
from sdt_drake.analysis.study import Stopwatch
from sdt_drake.errors import InputError
from sdt_drake.graphviz import has_graphviz
from sdt_drake.motion import Motion
from sdt_drake.pilot import felt_difference
from sdt_drake.tables import read_table

JOINTS = range(1, 5)
GEAR = np.array([67.2, 1, 1, 1])  # published
ROTOR = np.array([0.1291, 1.73, 0.531, 0.531])  # published

# reference_design.md: "What an independent calculation got" and "Published values".
I_EFF = {
    "i_eff_max": (4.2601, 98.0127, 796.298, 250.280),
    "i_eff_median": (4.004, 77.61, 792.10, 250.28),
    "i_eff_min": (3.830, 66.82, 774.84, 250.28),
}
VARIATION = (10.09, 31.82, 2.69, 0.0)
ZETA = (0.95, 0.98, 0.99, 0.95)
OMEGA_R = 2 * np.pi * 10.5028

# plant, process, algorithm, controller, disturbed: largest |speed error| of joints 1 to 4.
AXIS_ERRORS = {
    ("axis", "i_eff_max", "printed", "pi", False): (0.0272, 0.8688, 0.0145, 0.0546),
    ("axis", "i_eff_max", "printed", "pi_ctc", True): (0.0271, 0.1939, 0.0099, 0.0505),
    ("axis", "i_eff_min", "printed", "pi", False): (0.0272, 0.9001, 0.0147, 0.0526),
    ("axis", "i_eff_min", "printed", "pi_ctc", True): (0.0271, 0.1938, 0.0099, 0.0505),
    ("axis", "i_eff_max", "consistent", "pi", False): (0.0272, 0.2100, 0.0151, 0.0529),
    ("axis", "i_eff_max", "consistent", "pi_ctc", True): (0.0271, 0.1939, 0.0099, 0.0505),
}
# The same: largest, RMS, drift of the position [deg].
COUPLED = {
    ("coupled", "multibody", "consistent", "pi", False): (
        (0.0273, 0.2085, 0.0130, 0.0539), (0.01606, 0.06119, 0.00660, 0.02045), (8.3, 7.1, 0.5, 0.8)
    ),
    ("coupled", "multibody", "consistent", "pi_ctc", False): (
        (0.0273, 0.1865, 0.0112, 0.0523), (0.01606, 0.05625, 0.00663, 0.02029), (8.3, 5.5, 0.5, 0.7)
    ),
    ("coupled", "multibody", "printed", "pi_ctc", False): (
        (0.0275, 0.9153, 0.0240, 0.0779), (0.01607, 0.09215, 0.00685, 0.02060), (8.3, 8.9, 0.5, 0.8)
    ),
}  # fmt: skip
# Largest |speed error| of joint 2 at 11 s < t < 16.5 s, by file.
MIDDLE = {
    "axis_pi": 0.0470,
    "axis_pi_ctc": 0.0090,
    "coupled_pi": 0.0486,
    "coupled_pi_ctc": 0.0052,
}

RUN_COLUMNS = (
    "v_ref", "v", "tau_cmd", "tau", "load_torque", "speed_error", "q_ref", "q", "tau_limited",
    "tau_peak", "tau_rms", "saturated", "beyond_stop",
)  # fmt: skip
REFERENCE_COLUMNS = (
    "q_ref",
    "v_ref",
    "vd_ref",
    "tau_inertial",
    "tau_reaction",
    "tau_velocity",
    "tau_gravity",
    "tau_coupled",
    "load_torque",
    "alleviating_torque",
    "i_eff",
)
SVG_OF_DIAGRAMS = {f"diagrams/{name}.svg" for name in DIAGRAMS}
FILES = (
    {"summary.json", "reference.csv", "table1.md", "report.md"}
    | {f"{name}.csv" for name in MIDDLE}
    | {f"figure{k}.{suffix}" for k in (2, 4, 7, 8) for suffix in ("png", "svg")}
    | {f"diagrams/{name}.dot" for name in ("figure3", "figure4", "figure5", "figure6")}
)


def refuse_constant(name):
    raise AssertionError(f"{name} is not JSON")


@pytest.fixture(scope="module")
def content(written):
    """summary.json, by a strict reader."""
    text = (written.folder / "summary.json").read_text(encoding="utf-8")
    return json.loads(text, parse_constant=refuse_constant)


@pytest.fixture(scope="module")
def reference(written):
    return read_table(written.folder / "reference.csv")


def printed_digits(value, text):
    """`value` with as many significant digits as the printed `text`."""
    digits = len(text.partition("e")[0].replace(".", "").lstrip("0"))
    return float(f"{value:.{digits - 1}e}")


def tracking(content, key):
    """The entry of a run: plant, process, algorithm, controller, disturbed."""
    *names, disturbed = key
    (entry,) = [
        entry
        for entry in content["tracking"]
        if [entry[name] for name in ("plant", "process", "algorithm", "controller")] == names
        and (entry["disturbance_amplitude"] > 0) == disturbed
    ]
    return entry


# --- all files -------------------------------------------------------------------------------


def test_all_files_are_there_and_nothing_else_but_more_figures(written):
    files = {
        str(path.relative_to(written.folder))
        for path in written.folder.rglob("*")
        if path.is_file()
    }

    assert files >= FILES | {f"diagrams/{name}.dot" for name in DIAGRAMS}
    assert not [name for name in files if "partial" in name or name.startswith(".")]
    assert not (files & SVG_OF_DIAGRAMS) or files >= SVG_OF_DIAGRAMS
    assert bool(files & SVG_OF_DIAGRAMS) == has_graphviz()


def test_files_are_what_their_suffix_says(written):
    for path in written.folder.rglob("*.png"):
        assert path.read_bytes().startswith(b"\x89PNG\r\n"), path.name
    for path in written.folder.rglob("*.svg"):
        text = path.read_text(encoding="utf-8")
        assert "<svg" in text and "</svg>" in text, path.name
    for path in written.folder.rglob("*.dot"):
        assert path.read_text(encoding="utf-8").startswith("digraph"), path.name


def test_stages_are_told_as_they_pass(written):
    stages = [line.split("  ")[1].strip() for line in written.told]

    assert len(stages) == len(set(stages)) >= 5
    assert all(re.search(r"\d+\.\d\d s$", line) for line in written.told)


# --- summary.json ----------------------------------------------------------------------------


def test_keys_of_the_summary(content):
    assert set(content) == {
        "table1",
        "step_response",
        "tracking",
        "claims",
        "beyond",
        "versions",
        "wall_time_s",
    }
    row = {
        "joint",
        "i_eff_max",
        "i_eff_median",
        "i_eff_min",
        "variation_percent",
        "kp",
        "ki",
        "zeta_max",
        "zeta_median",
        "zeta_min",
    }
    assert [entry["joint"] for entry in content["table1"]] == [1, 2, 3, 4]
    for entry in content["table1"]:
        assert set(entry) == row | {"published"}
        assert set(entry["published"]) == row
    metrics = {"rise_time", "settling_time", "overshoot_percent"}
    steps = content["step_response"]
    assert set(steps) == {"pi", "p_in_feedback", "published"}
    assert set(steps["published"]) == {"pi", "p_in_feedback"}
    for entry in (steps, steps["published"]):
        assert set(entry["pi"]) >= metrics and set(entry["p_in_feedback"]) >= metrics
    assert set(content["versions"]) >= {"package", "drake", "numpy", "python"}
    for claim in content["claims"]:
        assert set(claim) == {"id", "statement", "published", "computed", "verdict", "why"}


def test_keys_of_the_tracking_entries(content):
    lists = (
        "max_abs_speed_error",
        "rms_speed_error",
        "constant_speed_error",
        "saturated_fraction",
        "max_abs_position_error",
    )
    for entry in content["tracking"]:
        assert set(entry) >= {"plant", "process", "algorithm", "controller", *lists}
        assert entry["plant"] in ("axis", "coupled")
        processes = ("i_eff_max", "i_eff_min") if entry["plant"] == "axis" else ("multibody",)
        assert entry["process"] in processes
        assert entry["algorithm"] in ("printed", "consistent")
        assert entry["controller"] in ("pi", "pi_ctc")
        for name in lists:
            assert len(entry[name]) == 4, name
            assert all(value is None or value >= 0 for value in entry[name]), name
        # Joint 3 swings: it has no constant speed, and JSON has no NaN.
        assert entry["constant_speed_error"][2] is None
        assert None not in entry["constant_speed_error"][:2]


def test_claims_of_the_summary_are_those_returned(content, written):
    assert [c["id"] for c in content["claims"]] == [c.id for c in written.claims]
    assert [c["verdict"] for c in content["claims"]] == [c.verdict for c in written.claims]


def test_versions_and_wall_time(content):
    assert content["versions"]["package"] == sdt_drake.__version__
    assert content["versions"]["numpy"] == np.__version__
    assert re.fullmatch(r"\d+\.\d+.*", content["versions"]["drake"])
    stages = content["wall_time_s"]
    assert len(stages) >= 5 and all(0 <= seconds < 600 for seconds in stages.values())


def test_a_number_that_does_not_exist_is_null(study, written):
    step = study.steps["pi"]
    never = dataclasses.replace(step.metrics, settling_time=math.nan, overshoot_percent=math.inf)
    changed = dataclasses.replace(
        study, steps=study.steps | {"pi": dataclasses.replace(step, metrics=never)}
    )
    text = json.dumps(summary(changed, written.claims), allow_nan=False)

    pi = json.loads(text)["step_response"]["pi"]
    assert pi["settling_time"] is None and pi["overshoot_percent"] is None


def test_table1_inertias(content):
    for name, expected in I_EFF.items():
        computed = [row[name] for row in content["table1"]]
        np.testing.assert_allclose(computed, expected, rtol=2e-4, err_msg=name)
    variation = [row["variation_percent"] for row in content["table1"]]
    np.testing.assert_allclose(variation, VARIATION, atol=0.006)


def test_table1_gains_to_the_printed_digits(content):
    kp = ("267.1", "6.34e3", "5.2e4", "1.57e4")
    ki = ("4.64e3", "1.07e5", "8.67e5", "2.72e5")  # printed is 2.73e5: an erratum
    for row, kp_text, ki_text in zip(content["table1"], kp, ki, strict=True):
        assert printed_digits(row["kp"], kp_text) == float(kp_text)
        assert printed_digits(row["ki"], ki_text) == float(ki_text)


def test_table1_gains_follow_from_the_inertia(content):
    i_eff = np.array([row["i_eff_max"] for row in content["table1"]])
    ki = 0.25 * OMEGA_R**2 * i_eff
    np.testing.assert_allclose([row["ki"] for row in content["table1"]], ki, rtol=1e-4)
    kp = np.array(ZETA) * OMEGA_R * i_eff  # 2 zeta sqrt(I K_IS) = zeta omega_r I
    np.testing.assert_allclose([row["kp"] for row in content["table1"]], kp, rtol=1e-4)


def test_table1_damping(content):
    rows = content["table1"]
    np.testing.assert_allclose([row["zeta_max"] for row in rows], ZETA, rtol=1e-9)
    for name in ("median", "min"):
        # K_PS and K_IS are fixed, so zeta goes with 1 / sqrt(I_eff).
        expected = ZETA / np.sqrt(np.divide(I_EFF[f"i_eff_{name}"], I_EFF["i_eff_max"]))
        np.testing.assert_allclose([row[f"zeta_{name}"] for row in rows], expected, rtol=2e-4)


def test_table1_published_side(content):
    published = [row["published"] for row in content["table1"]]
    assert [row["i_eff_max"] for row in published] == [4.26, 98.01, 796.3, 250.28]
    assert [row["variation_percent"] for row in published] == [39.95, 31.82, 7.29, 25.4]
    assert [row["kp"] for row in published] == [267.1, 6340, 52000, 15700]
    assert [row["ki"] for row in published] == [4640, 107000, 867000, 273000]
    assert [row["zeta_max"] for row in published] == list(ZETA)
    assert [row["zeta_median"] for row in published] == [1.06, 1.07, 1.009, 1.017]
    assert [row["zeta_min"] for row in published] == [1.23, 1.18, 1.03, 1.099]


def analytic_step(structure):
    """Rise 10-90 % [s], settling 2 % [s], overshoot [%] of the linear loop, in closed form."""
    omega_n, t = OMEGA_R / 2, np.linspace(0, 0.5, 500_001)
    if structure == "pi":  # zeta 1
        y = 1 + (omega_n * t - 1) * np.exp(-omega_n * t)
    else:
        zeta = 0.95
        omega_d = omega_n * np.sqrt(1 - zeta**2)
        swing = np.cos(omega_d * t) + zeta / np.sqrt(1 - zeta**2) * np.sin(omega_d * t)
        y = 1 - np.exp(-zeta * omega_n * t) * swing
    rise = t[np.argmax(y >= 0.9)] - t[np.argmax(y >= 0.1)]
    settling = t[np.flatnonzero(np.abs(y - 1) > 0.02)[-1]]
    return rise, settling, 100 * (y.max() - 1)


@pytest.mark.parametrize("structure", ["pi", "p_in_feedback"])
def test_step_responses(content, structure):
    rise, settling, overshoot = analytic_step(structure)
    computed = content["step_response"][structure]

    assert computed["rise_time"] == pytest.approx(rise, rel=0.01)
    assert computed["settling_time"] == pytest.approx(settling, rel=0.01)
    assert computed["overshoot_percent"] == pytest.approx(overshoot, rel=0.01)


def test_published_step_responses(content):
    assert content["step_response"]["published"] == {
        "pi": {"rise_time": 0.022, "settling_time": 0.16, "overshoot_percent": 13.53},
        "p_in_feedback": {"rise_time": 0.094, "settling_time": 0.159, "overshoot_percent": 0.0},
    }


@pytest.mark.parametrize("key", AXIS_ERRORS, ids=str)
def test_largest_errors_of_the_axis_runs(content, key):
    computed = tracking(content, key)["max_abs_speed_error"]

    np.testing.assert_allclose(computed, AXIS_ERRORS[key], rtol=0.02)


@pytest.mark.parametrize("key", COUPLED, ids=str)
def test_coupled_runs(content, key):
    entry = tracking(content, key)
    largest, rms, drift = COUPLED[key]

    np.testing.assert_allclose(entry["max_abs_speed_error"], largest, rtol=0.05)
    np.testing.assert_allclose(entry["rms_speed_error"], rms, rtol=0.05)
    np.testing.assert_allclose(np.degrees(entry["max_abs_position_error"]), drift, atol=0.06)


def test_steady_errors_of_the_coupled_plant(content):
    (claim,) = [c for c in content["claims"] if c["id"] == "ctc_steady_on_coupled_plant"]

    for name, key in (
        ("pi", ("coupled", "multibody", "consistent", "pi", False)),
        ("pi_ctc", ("coupled", "multibody", "consistent", "pi_ctc", False)),
    ):
        error = tracking(content, key)["constant_speed_error"]
        assert claim["computed"][name] == {"joint 2": error[1], "joint 4": error[3]}


def test_errors_in_the_middle_segment(study):
    """Joint 2, 11 s < t < 16.5 s, against the independent calculation."""
    for key, expected in (
        (("coupled", "multibody", "consistent", "pi", False), 0.0486),
        (("coupled", "multibody", "consistent", "pi_ctc", False), 0.0052),
        (("coupled", "multibody", "printed", "pi_ctc", False), 0.0970),
        (("axis", "i_eff_max", "printed", "pi", False), 0.0470),
        (("axis", "i_eff_max", "printed", "pi_ctc", True), 0.0090),
    ):
        recording = study.run(*key).recording
        inside = (recording.time > 11) & (recording.time < 16.5)
        largest = np.abs(recording.speed_error[inside, 1]).max()
        assert largest == pytest.approx(expected, rel=0.02)


def test_readme_shows_the_numbers_of_the_study(study):
    text = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    rows = {
        line.split("|")[1].strip(): line.split("|")[3]
        for line in text.splitlines()
        if line.count("|") == 4
    }

    def errors(name, plant, key, joint):
        runs = [
            study.run(plant, "i_eff_max" if plant == "axis" else "multibody", sign, kind, kind == d)
            for sign, kind, d in key
        ]
        return [getattr(run.tracking, name)[joint - 1] for run in runs]

    axis = [("printed", "pi", ""), ("printed", "pi_ctc", "pi_ctc")]
    coupled = [("consistent", "pi", ""), ("consistent", "pi_ctc", "")]
    for label, values in {
        "decoupled axes, joint 2, largest speed error: PI, PI + CTC": errors(
            "max_abs_speed_error", "axis", axis, 2
        ),
        "**coupled plant**, joint 2, largest speed error: PI, PI + CTC": errors(
            "max_abs_speed_error", "coupled", coupled, 2
        ),
        "coupled plant, joint 2 at constant speed, largest": errors(
            "constant_speed_error", "coupled", coupled, 2
        ),
        "coupled plant, joint 4 at constant speed, largest": errors(
            "constant_speed_error", "coupled", coupled, 4
        ),
    }.items():
        shown = [float(number) for number in re.findall(r"[\d.]+(?=[, ])", rows[label])]
        assert shown == [float(f"{value:.3g}") for value in values], label


def test_every_combination_of_the_axis_models_was_run(content):
    for algorithm in ("printed", "consistent"):
        for process in ("i_eff_max", "i_eff_min"):
            tracking(content, ("axis", process, algorithm, "pi", False))
            tracking(content, ("axis", process, algorithm, "pi_ctc", True))


# --- CSV files -------------------------------------------------------------------------------


def header(names):
    return ",".join(["time", *(f"{name}_{k}" for name in names for k in JOINTS)])


def test_header_of_the_reference(written):
    first = (written.folder / "reference.csv").read_text(encoding="utf-8").partition("\n")[0]

    assert first == header(REFERENCE_COLUMNS)


@pytest.mark.parametrize("name", MIDDLE)
def test_recordings(written, content, name):
    path = written.folder / f"{name}.csv"
    assert path.read_text(encoding="utf-8").partition("\n")[0] == header(RUN_COLUMNS)
    time, columns = read_table(path)

    np.testing.assert_allclose(time, 0.005 * np.arange(6001), atol=1e-12)
    np.testing.assert_array_equal(columns["speed_error"], columns["v"] - columns["v_ref"])
    middle = (time > 11) & (time < 16.5)
    largest = np.abs(columns["speed_error"][middle, 1]).max()
    assert largest == pytest.approx(MIDDLE[name], rel=0.02)

    plant, _, controller = name.partition("_")
    process, algorithm = {
        "axis": ("i_eff_max", "printed"),
        "coupled": ("multibody", "consistent"),
    }[plant]
    disturbed = name == "axis_pi_ctc"
    entry = tracking(content, (plant, process, algorithm, controller, disturbed))
    np.testing.assert_allclose(
        np.abs(columns["speed_error"]).max(axis=0), entry["max_abs_speed_error"], rtol=1e-12
    )
    saturated = columns["saturated"][1:].mean(axis=0)
    np.testing.assert_allclose(saturated, entry["saturated_fraction"], atol=1e-12)


def test_reference_groups_add_up(reference):
    _, columns = reference
    groups = sum(columns[f"tau_{name}"] for name in ("reaction", "velocity", "gravity"))

    np.testing.assert_allclose(columns["tau_coupled"], groups, atol=1e-8)
    largest = np.abs(columns["tau_coupled"]).max(axis=0)
    np.testing.assert_allclose(largest, [4031, 3419, 678, 288], atol=0.6)


def test_reference_loads_are_the_split_of_the_coupling(reference):
    _, columns = reference
    split = GEAR * (columns["load_torque"] - columns["alleviating_torque"])

    np.testing.assert_allclose(columns["tau_coupled"], split, atol=1e-8)
    # Help points along the acceleration, and is never more than the joint itself needs.
    help_ = GEAR * columns["alleviating_torque"] * np.sign(columns["vd_ref"])
    assert np.all(help_ >= -1e-9)
    assert np.all(help_ <= np.abs(columns["tau_inertial"]) + 1e-9)


def test_reference_inertial_torques_fit_the_effective_inertia(reference):
    _, columns = reference
    d_kk = GEAR**2 * (columns["i_eff"] - ROTOR)

    np.testing.assert_allclose(columns["tau_inertial"], d_kk * columns["vd_ref"], atol=1e-6)
    np.testing.assert_allclose(columns["i_eff"].max(axis=0), I_EFF["i_eff_max"], rtol=1e-4)


def test_reference_loads_as_a_motion(written, study):
    motion = Motion.from_csv(written.folder / "reference.csv")

    assert (motion.period, motion.n, len(motion.time)) == (0.005, 4, 6001)
    np.testing.assert_array_equal(motion.v, study.design.motion.v)
    np.testing.assert_array_equal(motion.q, study.design.motion.q)
    np.testing.assert_allclose(np.degrees(motion.q[:, 2].min()), -9.9, atol=0.05)
    np.testing.assert_allclose(np.degrees(motion.q[:, 3].max()), 18.0, atol=0.05)


# --- Markdown --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def report(written):
    return (written.folder / "report.md").read_text(encoding="utf-8")


def test_links_of_the_report_lead_somewhere(report, written):
    links = re.findall(r"\]\(([^)]+)\)", report)

    assert {"figure2.png", "figure4.png", "figure7.png", "figure8.png"} <= set(links)
    for link in links:
        assert (written.folder / link).is_file(), link
    for name in re.findall(r"`([\w/]+\.(?:dot|csv|json|md))`", report):
        assert (written.folder / name).is_file(), name


def test_report_has_every_claim_with_its_verdict_and_reason(report, written):
    rows = {line.split(" | ")[0].lstrip("| "): line for line in report.splitlines()}
    for claim in written.claims:
        assert f"**{claim.verdict}**" in rows[claim.id], claim.id
        assert claim.why in rows[claim.id], claim.id
    verdicts = [claim.verdict for claim in written.claims]
    for verdict in set(verdicts):
        assert f"{verdicts.count(verdict)} {verdict}" in report


def test_report_has_every_run_every_version_and_the_provenance(report, content):
    for entry in content["tracking"]:
        errors = " ".join(f"{value:.4f}" for value in entry["max_abs_speed_error"])
        assert errors in report
    for version in content["versions"].values():
        assert version in report
    assert "calibrated" in report and "assumed" in report
    assert not re.search(r"\b(nan|inf|None)\b", report)


def test_tables_of_the_report_are_rectangular(report):
    blocks = re.findall(r"(?:^\|.*\n)+", report, re.MULTILINE)
    assert len(blocks) >= 4
    for block in blocks:
        widths = {len(re.findall(r"(?<!\\)\|", line)) for line in block.splitlines()}
        assert len(widths) == 1, block[:200]


def test_report_reads_from_the_motion_to_the_verdicts(report):
    headings = re.findall(r"^## (.*)$", report, re.MULTILINE)

    def place(word):
        return next(i for i, heading in enumerate(headings) if word in heading.lower())

    order = [place(word) for word in ("motion", "table 1", "step response", "decoupled", "claims")]
    assert order == sorted(order)


def test_table1_markdown(written):
    text = (written.folder / "table1.md").read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]

    computed = {row[0]: row for row in rows[2:] if row[0].isdigit()}
    assert sorted(computed) == ["1", "2", "3", "4"]
    for k, row in computed.items():
        i = int(k) - 1
        assert float(row[1]) == pytest.approx(I_EFF["i_eff_max"][i], abs=0.006)
        assert float(row[4]) == pytest.approx(VARIATION[i], abs=0.006)
        assert float(row[7]) == pytest.approx(ZETA[i])
    published = [row for row in rows if "published" in row[0]]
    assert [row[5] for row in published] == ["267.1", "6.34e3", "5.2e4", "1.57e4"]
    assert [row[6] for row in published] == ["4.64e3", "1.07e5", "8.67e5", "2.73e5"]
    assert "calibrated" in text


# --- existing folders, and runs that fail ----------------------------------------------------


def quiet():
    return Stopwatch(lambda line: None)


def contents(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture
def used_folder(tmp_path):
    """A folder with old results and with files of somebody else."""
    folder = tmp_path / "used"
    (folder / "diagrams").mkdir(parents=True)
    (folder / "mine").mkdir()
    for name in ("report.md", "summary.json", "figure2.png", "reference.csv", "table1.md"):
        (folder / name).write_text(f"old {name}", encoding="utf-8")
    for name in ("notes.txt", "mine/data.csv", "diagrams/mine.dot", "figure99.png"):
        (folder / name).write_text(f"foreign {name}", encoding="utf-8")
    return folder


@pytest.fixture
def fast_figures(monkeypatch):
    """Figures cost most of the time: write few bytes instead."""

    def savefig(self, path, **options):
        path.write(b"a figure")

    monkeypatch.setattr(Figure, "savefig", savefig)


def test_existing_files_are_replaced_and_foreign_files_are_left_alone(
    study, written, used_folder, fast_figures
):
    write_study(study, used_folder, quiet())

    after = contents(used_folder)
    for name in ("notes.txt", "mine/data.csv", "diagrams/mine.dot", "figure99.png"):
        assert after.pop(name) == f"foreign {name}".encode()
    fresh = contents(written.folder)
    assert set(after) == set(fresh)
    for name in fresh:  # the same study gives the same bytes
        if name.endswith((".csv", ".dot")) or name in SVG_OF_DIAGRAMS or name == "table1.md":
            assert after[name] == fresh[name], name
    assert b"old" not in after["report.md"][:100] and after["figure2.png"] == b"a figure"
    json.loads(after["summary.json"])


def test_a_figure_that_cannot_be_made_leaves_the_old_results(study, used_folder, monkeypatch):
    before = contents(used_folder)

    def broken(*args, **kwargs):
        raise RuntimeError("no figure today")

    monkeypatch.setattr(plots, "speed_errors", broken)
    with pytest.raises(RuntimeError, match="no figure today"):
        write_study(study, used_folder, quiet())

    after = contents(used_folder)
    assert not [name for name in after if "partial" in name]
    for name in before.keys() - {"reference.csv"}:  # CSV files come first, whole
        assert after[name] == before[name], name
    assert Motion.from_csv(used_folder / "reference.csv").n == 4


def test_a_disk_that_fills_up_leaves_no_half_written_file(study, used_folder, monkeypatch):
    before = contents(used_folder)

    def write_bytes(path, data):
        with path.open("wb") as file:
            file.write(data[:10])
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr(Path, "write_bytes", write_bytes)
    with pytest.raises(InputError, match=r"figure2\.png: cannot be written \(No space left"):
        write_study(study, used_folder, quiet())

    after = contents(used_folder)
    assert after["figure2.png"] == before["figure2.png"]
    assert not [name for name in after if "partial" in name]
    assert after["report.md"] == before["report.md"]


# --- without Graphviz ------------------------------------------------------------------------


def test_without_graphviz_dot_files_are_written_and_the_report_says_what_is_missing(
    study, tmp_path, fast_figures, without_graphviz
):
    folder = tmp_path / "out"
    claims = write_study(study, folder, quiet())

    assert {path.name for path in (folder / "diagrams").iterdir()} == {
        f"{name}.dot" for name in DIAGRAMS
    }
    report = (folder / "report.md").read_text(encoding="utf-8")
    (line,) = [line for line in report.splitlines() if "Graphviz" in line]
    assert ".svg" in line and "install" in line
    for link in re.findall(r"\]\(([^)]+)\)", report):
        assert (folder / link).is_file(), link
    for name in DIAGRAMS:
        assert f"diagrams/{name}.dot" in report
    assert report == report_markdown(study, claims)


def test_with_graphviz_the_report_does_not_speak_of_it(report):
    if not has_graphviz():
        pytest.skip("Graphviz is not installed")

    assert "not installed" not in report
    assert set(re.findall(r"\]\((diagrams/[^)]+)\)", report)) == SVG_OF_DIAGRAMS


# --- what the pilot feels -----------------------------------------------------------------------


def test_every_controller_beyond_the_paper_has_what_is_felt_of_it(study, content):
    for entry, compared in zip(content["beyond"], study.beyond, strict=True):
        felt = entry["felt"]
        assert list(felt) == ["share", "share_from_angles", "channels", "largest", "channel_share"]
        head = compared.head
        assert felt["share"] == head.felt.share
        assert felt["share_from_angles"] == head.felt_from_angles.share
        assert felt["channels"] == ["roll", "pitch", "yaw", "fore-aft", "lateral", "vertical"]
        np.testing.assert_array_equal(felt["largest"], head.felt.multiples.max(axis=0))
        np.testing.assert_array_equal(felt["channel_share"], (head.felt.multiples > 1).mean(axis=0))
        assert felt["share"] >= max(felt["channel_share"])


def test_the_share_that_could_be_felt(content):
    """Runs that lose the position are felt nearly always, those that keep it hardly ever."""
    share = {entry["controller"]: entry["felt"]["share"] for entry in content["beyond"]}
    assert share["pi"] > 0.8 and share["pi_ctc"] > 0.8
    assert share["p_pi"] == pytest.approx(0.309, abs=0.005)
    assert share["p_pi"] > 3 * share["p_pi+ctc"] > 9 * share["p_pi+id"] > 0
    assert share["inverse_dynamics"] == 0


def test_the_report_says_whether_the_pilot_notices_that_ctc_is_missing(study, content, written):
    text = (written.folder / "report.md").read_text(encoding="utf-8")
    (answer,) = [line for line in text.splitlines() if "pilot notice that CTC" in line]
    by_label = {c.label: c for c in study.beyond}
    between = felt_difference(
        by_label["pi"].head.achieved, by_label["pi_ctc"].head.achieved, study.design.motion.period
    )
    assert f"{100 * between.share:.0f} % of the time" in answer
    for entry in content["beyond"]:
        if entry["controller"] in ("pi", "pi_ctc", "p_pi", "p_pi+ctc", "p_pi+id"):
            assert f"{100 * entry['felt']['share']:.1f} %" in answer


def test_a_difference_that_is_not_felt_is_called_so(study):
    """Computed, not written down: with CTC compared to itself the answer is no."""
    changed = dataclasses.replace(study)
    with_ctc = next(c for c in study.beyond if c.label == "pi_ctc")
    same = dataclasses.replace(with_ctc, label="pi")
    changed.__dict__["beyond"] = [same, *(c for c in study.beyond if c.label != "pi")]
    (answer,) = [x for x in report_markdown(changed, []).splitlines() if "that CTC is missing" in x]
    assert "No: the rides with and without it differ by at most 0.00" in answer
