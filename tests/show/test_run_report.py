"""The report of a run: what it says, and its plots in a browser."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import RUN, SHORT
from variants import kind

from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.frequency_response import frequency_response
from sdt_drake.analysis.illusions import feel, illusions
from sdt_drake.analysis.metrics import plain_number
from sdt_drake.analysis.orientation import CAUTION
from sdt_drake.analysis.tracking import track_head
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import Recording, simulate
from sdt_drake.show.figures.scope import torque_over_speed
from sdt_drake.show.panels import MAX_SAMPLES, Line, Panel
from sdt_drake.show.reports.run import run_report
from sdt_drake.show.style import Look

WAIT = 60_000  # ms at most, on a busy machine


@pytest.fixture(scope="module")
def run(designed):
    """Of joints that are asked to move at once, and saturate: design and recording."""
    drive = {"drive.n1": [150.0, 0.5, 0.05, 0.05], "drive.n0": [300.0, 4.0, 0.5, 0.5]}
    design = designed("axis_pi", drive, start=8.9, end=9.5, rest=20)
    return design, simulate(design)


def test_the_answer_comes_first_and_is_that_of_the_recording(run, tmp_path):
    design, recording = run
    text = run_report(design, recording, Path("x.html"), range(4)).markdown
    answer = text[text.index("## In short") : text.index("## What was run")]
    speed = np.abs(recording.v - recording.v_ref)
    lost = np.degrees(np.abs(recording.q - recording.q_ref))
    i, k = np.unravel_index(speed.argmax(), speed.shape)
    assert f"{speed.max():.4g} rad/s" in answer and f"at {recording.time[i]:.3f} s" in answer
    assert f"joint {k + 1}" in answer.splitlines()[2] and f"{lost.max():.4g} deg" in answer
    shares = recording.tau_peak.max(axis=0) / (design.robot.effort_limit / design.robot.gear_ratio)
    assert f"{100 * shares.max():.1f} %" in answer
    for k in range(4):
        share = 100 * recording.saturated[1:, k].mean()
        told = f"joint {k + 1} {plain_number(share)} % of the time"
        assert (told in answer) == (share > 0)
    assert f"with the inertia {design.scenario.plant.i_eff} kg m² on the motors" in text
    assert "can be felt" in answer and "Loops:** all are stable" in answer
    head = track_head(recording, design.robot).achieved
    for illusion in illusions(feel(head, design.motion.period, "clark2019"), head):
        assert f"\n- {illusion}.\n" in text
    assert "`clark2019` predicts" in text and CAUTION in text
    (tmp_path / "again.yaml").write_text(re.search(r"```\n(.*?)```", text, re.DOTALL)[1])
    assert load_scenario(tmp_path / "again.yaml") == design.scenario


def test_what_is_always_saturated_and_the_nearest_border_are_told(designed):
    design = designed("coupled_pi", kind("p_pi"), end=0.2)
    recording = simulate(design)
    recording.saturated[:, 1], recording.saturated[:, 2] = 1, 2e-5
    text = run_report(design, recording, Path("x.html"), range(4)).markdown
    assert "joint 2 100.00 % of the time, joint 3 0.002 % of the time." in text
    rise, fall = frequency_response(design).gain_margins_db  # less gain does no harm
    assert f"gain of joint {rise.argmin() + 1} may rise by {rise.min():.1f} dB" in text
    assert "smallest phase margin of a position loop" in text
    assert rise.min() > 0 and np.isnan(fall).all() and "cut at the position, all others" in text


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        (kind("p_pi+id", feedforward_gain=[0.5, 1.0, 1.0, 1.0]), "id times [0.5, 1.0, 1.0, 1.0]; "),
        (kind("pi"), ""),
    ],
)
def test_all_that_is_fed_forward_and_elastic_joints_are_told(designed, fields, told):
    fields |= {"controller.friction_compensation": True, "plant.friction.coulomb": [9.0] * 4}
    fields |= {"plant.elasticity.natural_frequency": [300.0, 0.0, 0.0, 0.0]}
    design = designed("coupled_pi", fields, end=0.1)
    recording = simulate(design)
    text = run_report(design, recording, Path("x.html"), range(4)).markdown
    assert "The speed of elastic joints is link speed" in text
    assert f"| torque feedforward | {told}friction at the speed of the reference |" in text
    assert Compared("", design, recording).needs[-1] == "joints' friction"


def test_torque_over_speed_lies_in_the_envelope_of_the_drive(run):
    design, recording = run
    panel = torque_over_speed(recording, design, 2)
    upper, lower, torque = (line.values for line in panel.lines)
    there = np.isfinite(torque)
    assert there.sum() == len(recording.time) and np.all(np.diff(panel.x) >= 0)
    order = np.argsort(recording.v[:, 2], kind="stable")
    np.testing.assert_allclose(torque[there], recording.tau[order, 2])
    left = np.clip((0.5 - panel.x) / (0.5 - 0.05), 0, 1)  # driving forwards
    np.testing.assert_allclose(upper, 2150 * left, atol=1e-6)
    np.testing.assert_allclose(lower, -2150 * np.clip((0.5 + panel.x) / 0.45, 0, 1), atol=1e-6)
    assert {-0.5, -0.05, 0.05, 0.5} <= set(panel.x)


def test_a_page_gets_every_sample_or_every_peak():
    n = 30 * MAX_SAMPLES
    time, noise = np.arange(n) / 200, np.random.default_rng(1).normal(size=(2, n))
    peaks = np.arange(123, n, n // 40)
    noise[0, peaks], noise[1, peaks + 3000] = 50, -40
    lines = [Line(str(i), Look("k"), values) for i, values in enumerate(noise)]
    rows = Panel("", "x", "y", time, lines).kept()
    assert len(rows) <= MAX_SAMPLES and {0, n - 1, *peaks, *(peaks + 3000)} <= set(rows.tolist())
    few = Panel("", "x", "y", time[:MAX_SAMPLES], [Line("", Look("k"), noise[0, :MAX_SAMPLES])])
    assert len(few.kept()) == MAX_SAMPLES
    marked = Panel("", "x", "y", time[:5], [], np.array([True, False, True, True, True]))
    assert marked.spans() == [(0, 0), (0.01, 0.02)]


def read(plot):
    """What the legend of a plot says at the cursor."""
    cells = (plot.locator(f".u-series .u-{x}").all_inner_texts() for x in ("label", "value"))
    return dict(zip(*cells, strict=True))


def point(plot, share):
    plot.scroll_into_view_if_needed()
    box = plot.locator(".u-over").bounding_box()
    plot.page.mouse.move(box["x"] + share * box["width"], box["y"] + box["height"] / 2)


def shows(plot, time):
    """Wait until this is the time at the cursor."""
    near = "([cell, time]) => Math.abs(cell.innerText - time) < 0.011"
    cell = plot.locator(".u-value").first.element_handle()
    plot.page.wait_for_function(near, arg=[cell, time], timeout=WAIT)


def fits(page):
    """Wait until every plot fits into its place."""
    fits = "x => x.offsetWidth <= x.parentElement.clientWidth"
    page.wait_for_function(f"[...document.querySelectorAll('.uplot')].every({fits})")


def test_plots_of_the_page_are_zoomed_and_read_off(open_page, good, desk, given):
    meant = "{quantity: yaw rate, sign: -1, start: 0, end: 0.01}"
    given("short.yaml", f"{SHORT}feels: a turn to the right\nillusion: {meant}\n")
    said = good("simulate", RUN, "--out", "report.html").out
    good("simulate", RUN, "--out", "run.csv")
    recording = Recording.from_csv("run.csv")
    assert re.search(r"report.html: \d\.\d MB, all in one file\nreport.html written\n$", said)
    with open_page(desk / "report.html", width=1400) as (page, errors, requests):
        speed, torque, over_speed = (
            page.locator(".plots").nth(figure).locator(".uplot").nth(panel)
            for figure, panel in ((1, 1), (3, 4), (4, 1))
        )

        fits(page)
        assert page.get_by_text("To be felt: a turn to the right clark2019 does not").is_visible()
        point(speed, 0.5)
        shows(speed, 0.25)
        shown = read(speed)
        i = round(float(shown["time [s]"]) / 0.005)
        assert shown["reference"] == f"{recording.v_ref[i, 1]:.5g}"
        assert float(shown["achieved"]) == pytest.approx(recording.v[i, 1], rel=1e-4)
        shows(torque, 0.25)  # of another joint, too
        there = read(torque)
        assert there["time [s]"] == shown["time [s]"]
        assert float(there["motor torque"]) == pytest.approx(recording.tau[i, 3], rel=1e-4)
        assert float(there["limits of the motor"]) == 2150

        point(speed, 0.25)
        page.mouse.down()
        point(speed, 0.5)
        page.mouse.up()
        for share, time in ((0.01, 0.125), (0.5, 0.1875), (0.99, 0.25)):
            point(speed, share)
            shows(speed, time)
            shows(torque, time)
        page.locator(".plots").nth(1).get_by_role("button", name="show all").click()
        point(torque, 0.99)
        shows(torque, 0.5)

        point(over_speed, 0.5)
        cell = over_speed.locator(".u-value").first
        page.wait_for_function("cell => cell.innerText !== '–'", arg=cell.element_handle())
        at = {name: float(value) for name, value in read(over_speed).items()}
        near = np.abs(recording.v[:, 1] - at["motor speed [rad/s]"]) < 1e-4
        assert np.abs(recording.tau[near, 1] - at["motor torque"]).min() < 0.1
        page.set_viewport_size({"width": 400, "height": 800})
        fits(page)
        assert page.evaluate("document.documentElement.scrollWidth") == 400
        assert (errors, requests) == ([], [])


def test_a_report_of_what_cannot_be_linearised_and_has_no_pilot(good, desk, given):
    shutil.copy(Path(__file__).parents[1] / "own_controllers.py", desk.parent / "given" / "own.py")
    heavier = "{inertia_scale: 1.1}"
    controller = f"{{kind: proportional, file: own.py, omega_r: 66, model: {heavier}}}"
    plant = f"{{kind: coupled, deviation: {heavier}}}"
    text = f"robot: arm.sdf\nmotion: arm.yaml\nplant: {plant}\ncontroller: {controller}\n"
    good("simulate", given("own.yaml", text), "--joint", "2", "--out", "new/own.md", "--trust")
    written = (desk / "new" / "own.md").read_text(encoding="utf-8")
    assert "There is no linear analysis: controller.kind proportional" in written
    assert "pilot" not in written.lower().replace("the pilot's", "")
    shown = re.findall(r"\]\((own_\w+\.(?:png|html))\)", written)
    assert shown == ["own_joint_2.png", "own_torque.png", "own_3d.html"]
    assert {path.name for path in (desk / "new").iterdir()} == {"own.md", *shown}
    assert re.search("controller's model.*exact", written)  # as wrong as what moves
    assert written.startswith("# own: proportional on the coupled plant\n")
