"""The paper recomputed: its numbers, and what its report says."""

import base64
import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.command_line import snapshot

from sdt_drake.io.tables import read_table
from sdt_drake.motion import Motion
from sdt_drake.paper import files, reproduction

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
# Plant, controller, algorithm: largest |speed error| of joint 2 at 11 s < t < 16.5 s.
MIDDLE = {
    ("axis", "pi", "printed"): 0.0470,
    ("axis", "pi_ctc", "consistent"): 0.0090,
    ("coupled", "pi", "consistent"): 0.0486,
    ("coupled", "pi_ctc", "consistent"): 0.0052,
    ("coupled", "pi_ctc", "printed"): 0.0970,
}
FILES = {
    "axis_pi": ("axis", "i_eff_max", "printed", "pi", False),
    "axis_pi_ctc": ("axis", "i_eff_max", "printed", "pi_ctc", True),
    "coupled_pi": ("coupled", "multibody", "consistent", "pi", False),
    "coupled_pi_ctc": ("coupled", "multibody", "consistent", "pi_ctc", False),
}
REFERENCE_COLUMNS = "q_ref v_ref vd_ref tau_inertial tau_reaction tau_velocity tau_gravity "
REFERENCE_COLUMNS += "tau_coupled load_torque alleviating_torque i_eff"


@pytest.fixture(scope="module")
def content(reproduced):
    """summary.json, by a strict reader."""

    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    text = (reproduced / "summary.json").read_text(encoding="utf-8")
    return json.loads(text, parse_constant=refuse)


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


def test_table_1_equals_the_paper(content):
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


@pytest.mark.parametrize("key", LARGEST, ids=str)
def test_largest_errors_equal_the_paper(content, key):
    entry = entry_of(content, key)
    tolerance = 0.02 if key[0] == "axis" else 0.05
    np.testing.assert_allclose(entry["max_abs_speed_error"], LARGEST[key], rtol=tolerance)
    if key[0] == "coupled":
        rms, drift = RMS_AND_DRIFT[key[2:4]]
        np.testing.assert_allclose(entry["rms_speed_error"], rms, rtol=0.05)
        np.testing.assert_allclose(np.degrees(entry["max_abs_position_error"]), drift, atol=0.06)


def test_errors_at_constant_speed_equal_the_paper(reproduction):
    for (plant, *of), expected in MIDDLE.items():
        recording = getattr(reproduction, plant)(*of).recording
        middle = (recording.time > 11) & (recording.time < 16.5)
        largest = np.abs(recording.speed_error[middle, 1]).max()
        assert largest == pytest.approx(expected, rel=0.02), of


def test_pilot_sentences_of_the_report_hold(content):
    """Its sentences stand in a file: the numbers must agree with their words."""
    share = {e["controller"]: e["felt"]["share"] for e in content["beyond"]}
    angles = {e["controller"]: e["felt"]["share_from_angles"] for e in content["beyond"]}
    assert content["pi_or_pi_ctc"]["share"] > 0.5
    assert 0 <= share["pi"] - share["pi_ctc"] < 0.1 < 0.8 < share["pi_ctc"]
    assert min(angles["pi"], angles["pi_ctc"]) > 0.5 * share["pi_ctc"]
    assert share["p_pi"] == pytest.approx(0.309, abs=0.005)
    assert share["p_pi"] > 3 * share["p_pi+ctc"] > 9 * share["p_pi+id"] > 0
    assert share["inverse_dynamics"] == 0


def test_findings_show_the_recomputed_numbers(content):
    text = (Path(__file__).parents[2] / "diagrams/README.md").read_text(encoding="utf-8")
    lines = [line.split("|") for line in text.splitlines() if line.count("|") == 4]
    rows = {line[1].strip(): line[3] for line in lines}
    axis, coupled = (
        [entry_of(content, FILES[f"{plant}_{name}"]) for name in ("pi", "pi_ctc")]
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


def test_reference_torque_groups_add_up(reproduced, reproduction):
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
    np.testing.assert_array_equal(motion.q, reproduction.design.reference.tracked.q)
    np.testing.assert_allclose(np.degrees(motion.q[:, 2].min()), -9.9, atol=0.05)


def test_stages_of_a_computation_add_up_their_times(monkeypatch):
    clock = SimpleNamespace(perf_counter=iter([1.0, 3.0, 10.0, 14.5]).__next__)
    monkeypatch.setattr(reproduction, "time", clock)
    watch = reproduction.Stopwatch((told := []).append)
    for _ in range(2):
        with watch.stage("runs"):
            pass
    assert watch.seconds == {"runs": 6.5} and [line.split()[1] for line in told] == ["2.00", "6.50"]


# --- files -----------------------------------------------------------------------------------


def test_plots_of_the_report_are_the_runs_and_come_before_the_claims(reproduced, reproduction):
    plots = json.loads((reproduced / "plots.json").read_text(encoding="utf-8"))
    arrays, panels = plots["figure8"]["arrays"], plots["figure8"]["panels"]
    for k, panel in enumerate(panels):
        for line, name in zip(panel["lines"], ("pi", "pi_ctc"), strict=True):
            shown = np.frombuffer(base64.b64decode(arrays[line["values"]]), "<f4")
            error = reproduction.axis(name).recording.speed_error[:, k]
            np.testing.assert_array_equal(shown, error.astype("<f4"))
    text = (reproduced / "report.md").read_text(encoding="utf-8")
    read = ("## Summary", 'class="tiles"', "figure8.png", "figure7.png", "## Device", "## Claims")
    assert sorted(read, key=text.index) == list(read)
    page = (reproduced / "report.html").read_text(encoding="utf-8")
    assert "I<sub>eff,max</sub>" in page and "I_eff,max" in text


def test_reproduce_writes_exactly_its_files(reproduced):
    """What it may replace, and what it checks before it computes."""
    assert set(snapshot(reproduced)) == {"diagrams", *files.FILES}
    text = (reproduced / "report.md").read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#]+)\)", text)
    assert links and all(x.startswith("http") or (reproduced / x).is_file() for x in links)
