"""`sdt-drake pilot` as a user meets it."""

from __future__ import annotations

import re
from importlib import import_module

import numpy as np
import pytest
from command_line import ENDS, SDF, read_csv, refused

from sdt_drake.analysis.illusions import feel, illusions
from sdt_drake.analysis.orientation import CAUTION, perceive
from sdt_drake.analysis.perception import CHANNELS, DETECTORS, LINEAR, canals
from sdt_drake.analysis.tracking import track_head
from sdt_drake.io.tables import read_table
from sdt_drake.robot.robot import load_robot
from sdt_drake.run.simulate import Recording

CSV_COLUMNS = [
    f"{name}{suffix}_{k}"
    for suffix in ("_ref", "")
    for name in (
        "specific_force",
        "angular_velocity",
        "angular_acceleration",
        "canals",
        "felt_gravity",
        "felt_rate",
        "felt_acceleration",
    )
    for k in (1, 2, 3)
]


@pytest.fixture
def recording(good, desk):
    """A recording of the coupled plant, `run.csv` in the working directory."""
    good("simulate", "../given/coupled.yaml", "--out", "run.csv")
    return Recording.from_csv(desk / "run.csv")


def headless(folder):
    text = re.sub(r'<frame name="head".*?</frame>', "", SDF, flags=re.S)
    (folder / "headless.sdf").write_text(text, encoding="utf-8")


def rows_of(out):
    """Cells of the lines that have at least two of them, by the first cell."""
    rows = [re.split(r"\s{2,}", line.strip()) for line in out.splitlines()]
    return {row[0]: row[1:] for row in rows if len(row) > 1}


def test_prints_what_the_head_does(good, recording, robot):
    done = good("pilot", "run.csv")
    rows = rows_of(done.out)
    head = track_head(recording, robot)

    assert done.out.startswith("run: what the pilot feels")
    for column, motion in enumerate((head.reference, head.achieved)):
        assert float(rows["largest G"][column]) == pytest.approx(motion.resultant_g.max(), abs=6e-4)
        assert float(rows["smallest G"][column]) == pytest.approx(
            motion.resultant_g.min(), abs=6e-4
        )
        for k, axis in enumerate(("roll", "pitch", "yaw")):
            rate = np.degrees(np.abs(motion.angular_velocity[:, k]).max())
            assert float(rows[f"{axis} rate, largest [deg/s]"][column]) == pytest.approx(
                rate, abs=0.051
            )
        felt = perceive(recording.time, motion.specific_force, motion.angular_velocity)
        for label, angle in (("felt roll", felt.roll), ("felt pitch", felt.pitch)):
            (label,) = (row for row in rows if row.startswith(label))
            largest = np.degrees(np.abs(angle).max())
            assert float(rows[label][column]) == pytest.approx(largest, abs=0.051)
    for k, channel in enumerate(CHANNELS):
        largest, at, share, alone, alone_share = map(float, rows[channel])
        assert largest == pytest.approx(head.felt.largest[k], abs=0.0051)
        assert head.felt.multiples[round(at / 0.005), k] == head.felt.largest[k]
        assert share == pytest.approx(100 * head.felt.channel_share[k], abs=0.051)
        assert alone == pytest.approx(head.felt_from_angles.largest[k], abs=0.0051)
        assert alone_share == pytest.approx(100 * head.felt_from_angles.channel_share[k], abs=0.051)
    assert f"could be felt {100 * head.felt.share:.1f} % of the time" in done.out
    first, second = (
        perceive(recording.time, motion.specific_force, motion.angular_velocity)
        for motion in (head.reference, head.achieved)
    )
    cosine = np.sum(first.gravity * second.gravity, axis=1)
    sizes = np.linalg.norm(first.gravity, axis=1) * np.linalg.norm(second.gravity, axis=1)
    angle = np.degrees(np.arccos(np.minimum(cosine / sizes, 1)).max())
    rate = np.degrees(np.linalg.norm(second.rate - first.rate, axis=1).max())
    told = re.search(r"felt vertical by at most (\S+) deg, felt rotation (\S+) deg/s", done.out)
    assert [float(x) for x in told.groups()] == pytest.approx([angle, rate], abs=0.0051)
    for illusion in illusions(second, head.achieved):
        assert f"  {illusion}\n" in done.out
    assert CAUTION in done.out


def test_another_model_of_the_pilot(good, call, recording):
    usual, other = (good("pilot", "run.csv", *more).out for more in ((), ("--model", "slow_yaw")))
    row = "felt roll from the vertical, largest [deg]"
    assert rows_of(usual)[row] != rows_of(other)[row] and "by slow_yaw:" in other
    refused(call("pilot", "run.csv", "--model", "slow"), "slow: no such perception model")


def test_that_no_illusion_is_predicted_is_told(good, recording, monkeypatch):
    monkeypatch.setattr(import_module("sdt_drake.analysis.illusions"), "illusions", lambda *_: [])
    assert "by clark2019:\n  nothing: no illusion is predicted\n" in good("pilot", "run.csv").out


def test_a_scenario_is_run_as_simulate_runs_it(good, recording):
    by_recording = good("pilot", "run.csv").out.partition("\n")[2]
    by_scenario = good("pilot", "../given/coupled.yaml").out
    assert by_scenario.startswith("coupled: ")
    assert by_scenario.partition("\n")[2] == by_recording


def test_csv_holds_it_over_time(good, desk, recording, robot):
    done = good("pilot", "run.csv", "--out", "new/felt.csv")
    assert done.out.splitlines()[-1] == "new/felt.csv written"
    header = read_csv(desk / "new" / "felt.csv")[0]
    assert header == ["time", *CSV_COLUMNS, *(f"multiple_{k}" for k in range(1, 7))]
    time, columns = read_table(desk / "new" / "felt.csv")

    np.testing.assert_array_equal(time, recording.time)
    head = track_head(recording, robot)
    for suffix, motion in (("_ref", head.reference), ("", head.achieved)):
        omega, force = motion.angular_velocity, motion.specific_force
        for name, values in (
            ("specific_force", force),
            ("angular_velocity", omega),
            ("angular_acceleration", motion.angular_acceleration),
            ("canals", canals(omega, 0.005)),
            *(
                (f"felt_{n}", values)
                for n, values in feel(motion, 0.005, "clark2019").columns.items()
            ),
        ):
            np.testing.assert_array_equal(columns[name + suffix], values)
    np.testing.assert_array_equal(columns["multiple"], head.felt.multiples)
    # By hand, from the file alone.
    force = columns["specific_force"] - columns["specific_force_ref"]
    np.testing.assert_allclose(columns["multiple"][:, 3:], np.abs(force) / LINEAR)
    omega = columns["angular_velocity"] - columns["angular_velocity_ref"]
    by_detector = [detector.multiples(omega, 0.005) for detector in DETECTORS]
    np.testing.assert_allclose(columns["multiple"][:, :3], np.max(by_detector, axis=0), atol=1e-12)


def test_another_robot(good, desk, recording):
    """The head in the arm: only the first joint moves it."""
    text = SDF.replace('name="head" attached_to="payload"', 'name="head" attached_to="arm"')
    (desk / "arm.sdf").write_text(text, encoding="utf-8")
    rows = rows_of(good("pilot", "run.csv", "--robot", "arm.sdf").out)
    head = track_head(recording, load_robot(desk / "arm.sdf"))
    assert float(rows["lateral"][0]) == pytest.approx(head.felt.largest[4], abs=0.0051)
    assert head.felt.largest[:2].max() == 0


# --- what cannot be done ------------------------------------------------------------------------


def test_a_robot_without_a_head_is_refused_before_anything_is_planned(
    call, desk, recording, monkeypatch
):
    monkeypatch.setattr(import_module("sdt_drake.run.design"), "load_plan", None)
    headless(desk)
    text = ENDS["coupled"].replace("motion.yaml", "../given/motion.yaml")
    (desk / "headless.yaml").write_text(text + "robot: headless.sdf\n", encoding="utf-8")
    for given in (("run.csv", "--robot", "headless.sdf"), ("headless.yaml",)):
        refused(
            call("pilot", *given, "--out", "x.png"), "headless.sdf: no pilot's head; add <frame"
        )
    view = ("view", "headless.yaml", "--pilot", "--record", "x.html")
    refused(call(*view), "headless.sdf: no pilot's head; add <frame")
    assert not (desk / "x.png").exists()


def test_a_recording_of_another_number_of_joints_is_refused(call, desk, recording):
    lines = (desk / "run.csv").read_text(encoding="utf-8").splitlines()
    keep = [i for i, name in enumerate(lines[0].split(",")) if not name.endswith("_4")]
    less = "\n".join(",".join(line.split(",")[i] for i in keep) for line in lines)
    (desk / "less.csv").write_text(less, encoding="utf-8")
    refused(
        call("pilot", "less.csv"),
        "less.csv: recorded with 3 joint(s), but sdt has 4; --robot names that",
    )


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (("none.csv",), ("none.csv: no such file",)),
        (("../given/motion.yaml",), ("motion.yaml: is a motion, expected a scenario",)),
        (("coriolis",), ("coriolis: is a motion, expected a scenario",)),
        (("../given/coupled.yaml", "--robot", "x.sdf"), ("--robot", "coupled.yaml")),
        (("run.csv", "--robot", "none.sdf"), ("none.sdf: no such file",)),
    ],
)
def test_bad_input_is_refused(call, desk, options, parts):
    refused(call("pilot", *options), *parts)
    assert list(desk.iterdir()) == []


# --- the model of the pilot itself --------------------------------------------------------------


def test_validate_tells_what_people_reported_first(good, desk):
    out = good("pilot", "--validate").out
    assert out.startswith(
        "No gain set passes both: of what people reported, yaw decay by irmak2023"
    )
    rows = rows_of(out)
    assert rows["turn_2_start"][0] == "17.2 ± 6.4" and rows["turn_2_start"][1] == "57.5 +6.3"
    assert rows["yaw_start"] == ["13 to 20", "27.2 +3.1", "14.0 ✓", "16.1 ✓", "14.0 ✓"]
    assert rows["g_excess"][2] == "+1.1 ✗" and rows["graveyard_spin"][1] == "-74.3 ✓"
    assert "no medical statement" in " ".join(out.split())
    assert list(desk.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ((), "expected a scenario, a recording or --validate, one of them"),
        (("coupled_pi", "--validate"), "expected a scenario, a recording or --validate, one of"),
        (("--validate", "--out", "x.png"), "--out: not with --validate"),
        (("--validate", "--pilots", "20"), "--pilots: of a motion, not with --validate"),
        (("leans", "--pilots", "20", "--out", "x.png"), "--out: not with --pilots"),
        (("leans", "--pilots", "0"), "--pilots"),
        (("coupled_pi", "--pilots", "2"), "coupled_pi: is a scenario, expected a motion"),
    ],
)
def test_validate_stands_alone(call, desk, options, part):
    refused(call("pilot", *options), part)


def test_how_many_pilots_feel_it_is_told_first(good, desk):
    out = good("pilot", "leans", "--pilots", "3").out
    said = " ".join(out.split())
    assert said.startswith(
        "3 of 3 pilots (100 %, 95 % interval 44 to 100 %) are predicted to feel it: leans, roll wro"
    )
    assert "Dai, Klein, Cohen & Raphan 1999" in said and said.endswith(CAUTION)
    assert good("pilot", "leans", "--pilots", "3").out == out
    assert list(desk.iterdir()) == []
