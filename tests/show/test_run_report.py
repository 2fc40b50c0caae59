"""The report of a run: what it says, and its plots in a browser."""

import re

import numpy as np
import pytest
from helpers.command_line import RUN, SHORT

from sdt_drake.run.recording import Recording
from sdt_drake.show.documents import Report
from sdt_drake.show.panels import MAX_SAMPLES, Line, Panel, Plots
from sdt_drake.show.sections import Picture, Section
from sdt_drake.show.style import Look

WAIT = 60_000  # ms at most, on a busy machine


def test_plots_get_every_sample_or_every_peak():
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


def test_page_plots_zoom_and_read_off(open_page, good, desk, given):
    meant = "{quantity: yaw rate, sign: -1, start: 0, end: 0.01}"
    given("short.yaml", f"{SHORT}feels: a turn to the right\nillusion: {meant}\n")
    said = good("simulate", RUN, "--out", "report.html").out
    good("simulate", RUN, "--out", "run.csv")
    recording = Recording.load("run.csv")
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
        for name, time in (("to the left", 0.156), ("to the right", 0.1875)):
            page.locator(".plots").nth(1).get_by_role("button", name=name).click()
            point(speed, 0.49)
            point(speed, 0.5)
            shows(speed, time)
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


def test_grey_ground_covers_the_marked_times(open_page, tmp_path):
    time = np.linspace(0, 1, 101)
    panel = Panel("", "x", "y", time, [Line("a", Look("k"), 0 * time)], time < 0.4, "grey")
    path = tmp_path / "a.html"
    text = Report("t", [], [Section("s", [Picture("p.png", "c", Plots([[panel]]))])]).page(tmp_path)
    path.write_text(text, encoding="utf-8")
    with open_page(path) as (page, errors, _):
        fits(page)
        shades = """canvas => [0.3, 0.8].map(share => canvas.getContext("2d").getImageData(
          share * canvas.width, 0.3 * canvas.height, 1, 1).data[3])"""
        marked, other = page.locator(".uplot canvas").evaluate(shades)
        assert marked > 20 and other == 0 and errors == []
