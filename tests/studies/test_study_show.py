"""What `sdt-drake study show` prints and draws, and report.html of a study."""

from __future__ import annotations

import dataclasses
import re
import sys
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from synthetic import CONTROLLERS, make_table, small_table

from sdt_drake.errors import InputError
from sdt_drake.studies import page, show

sys.path.insert(0, str(Path(__file__).parents[1]))
from browser import open_page

EVIL = '</script><b onload="x">&'


@pytest.fixture(scope="module")
def table():
    return make_table(60, joints=2)


@pytest.fixture(scope="module")
def folder(table, tmp_path_factory):
    """Figures and page; do not change it."""
    folder = tmp_path_factory.mktemp("study") / "my results"
    page.write_report(table, folder, "controller")
    return folder


@pytest.fixture(scope="module")
def report(folder):
    return folder / "report.html"


def text_of(path):
    parser, texts = HTMLParser(), []
    parser.handle_data = texts.append
    parser.feed(path.read_text(encoding="utf-8"))
    return re.sub(r"\s+", " ", " ".join(texts))


# --- tables ----------------------------------------------------------------------------------


def test_tables_are_rectangular_and_of_texts(table):
    tables = show.summary_tables(table, "controller")
    assert [t.title for t in tables] == [
        "Runs by status",
        "Percentiles: largest speed error [rad/s]",
        "Percentiles: largest position error [deg]",
        "Percentiles: peak torque [% of the motor]",
        "Percentiles: error that can be felt [% of time]",
        "Worst runs: largest speed error",
        "Worst runs: largest position error",
        "Worst runs: peak torque",
        "Worst runs: error that can be felt",
        *(f"Variance explained by each input alone [%], {c}" for c in CONTROLLERS),
    ]
    for _, header, rows in tables:
        assert rows and {len(row) for row in rows} == {len(header)}
        assert all(isinstance(cell, str) for row in (header, *rows) for cell in row)


def test_status_table(table):
    _, _, rows = show.status_table(table)
    assert rows[0] == ["ok", "176", "97.8", "", ""]
    assert rows[1] == ["infeasible", "4", "2.2", "", ""]
    assert rows[2] == ["", "4", "", "7", "joint 2 needs … N m, expected at most 90 N m"]


def test_percentile_table_is_in_the_unit_of_its_title(table):
    title, header, rows = show.percentile_table(
        table, ["max_abs_position_error", "max_abs_position_error_2"], "controller"
    )
    assert title.endswith("[deg]")
    assert header == ["controller", "5 %", "25 %", "50 %", "75 %", "95 %", "99 %", "largest"]
    assert [row[0] for row in rows[:2]] == ["pi, worst joint", "pi, joint 2"]
    part = table.split("controller")["pi"]
    largest = np.degrees(np.nanmax(part.outcomes["max_abs_position_error_2"]))
    assert rows[1][-1] == f"{largest:.4g}"


def test_worst_table_names_run_joint_and_inputs(table):
    _, header, rows = show.worst_table(table, "max_abs_speed_error", "controller", count=2)
    assert header == [
        "row", "joint", "rad/s", "controller", "omega_r", "payload", "friction", "motion",
    ]  # fmt: skip
    assert [row[3] for row in rows] == ["pi", "pi", "pi_id", "pi_id", "p_pi+id", "p_pi+id"]
    i = int(rows[0][0])
    assert rows[0][1] == "2"
    assert rows[0][2] == f"{table.outcomes['max_abs_speed_error_2'][i]:.4g}"
    assert rows[0][4] == f"{table.inputs['omega_r'][i]:.4g}"
    assert "joint" not in show.worst_table(table, "felt_share").header


def test_sensitivity_table(table):
    families = ["max_abs_speed_error", "saturated_fraction"]
    (_, header, rows), *_ = show.sensitivity_tables(table, families, "controller")
    assert header == ["input", "largest speed error", "saturation"]
    assert [row[0] for row in rows[:2]] == ["omega_r", "payload"] and rows[-1][0] == "sum"
    assert [row[2] for row in rows] == ["–", "–", "–", "–", "–"]  # it is 0 in all runs
    shares = [float(row[1]) for row in rows]
    assert shares[-1] == pytest.approx(sum(shares[:-1]), abs=0.3) and min(shares) >= 0
    joints = ["rms_torque_share", "rms_torque_share_1", "rms_torque_share_2"]
    header = show.sensitivity_tables(table, joints)[0].header
    assert header == ["input", "worst joint", "joint 1", "joint 2"]


def test_the_controller_is_told_apart_before_other_texts(table):
    assert show.grouping(table) == "controller"
    without = {name: v for name, v in table.inputs.items() if name != "controller"}
    assert show.grouping(dataclasses.replace(table, inputs=without)) == "motion"
    many = {"file": table.row.astype(str), "same": np.full(len(table), "x")}
    assert show.grouping(dataclasses.replace(table, inputs=many)) is None


def test_headlines_are_those_that_some_run_has(table):
    assert show.headlines(table)[-1] == "felt_share"
    nowhere = table.outcomes | {"felt_share": np.full(len(table), np.nan)}
    assert "felt_share" not in show.headlines(dataclasses.replace(table, outcomes=nowhere))
    assert show.headlines(small_table(np.arange(3.0))) == ["y"]


# --- figures and page ------------------------------------------------------------------------


def test_files(folder):
    assert {path.name for path in folder.iterdir()} == {"report.html"} | {
        f"{name}.{suffix}"
        for name in ("distributions", "tornado", "scatter", "pareto")
        for suffix in ("svg", "png")
    }


def test_the_page_has_everything(report):
    text = text_of(report)
    assert "Study gains" in text and "180 runs" in text and "90.0 s of computation" in text
    assert "176 ok 4 infeasible" in text
    assert "Largest position error [deg], worst joint: 95 % of the runs stay below" in text
    for caption in page.CAPTIONS.values():
        assert caption in text
    assert "Percentiles: peak torque [% of the motor]" in text
    assert "Variance explained by each input alone [%], p_pi+id" in text


def test_the_page_says_how_to_repeat_each_of_the_worst_runs(report, folder, table):
    text = text_of(report)
    for row in show.worst_table(table, "peak_torque_share", "controller").rows:
        assert f"sdt-drake study repeat '{folder}' --row {row[0]} " in text


def test_the_page_is_the_same_each_time(tmp_path):
    y = np.arange(30.0)
    table = small_table(y, x=y, c=["a", "b"] * 15)
    one, two = (page.write_report(table, tmp_path).read_bytes() for _ in range(2))
    assert one == two


def test_ids_are_unique(report):
    ids = re.findall(r'\bid="([^"]*)"', report.read_text(encoding="utf-8"))
    assert len(ids) == len(set(ids)) > 100


def test_all_text_is_escaped(tmp_path):
    y = np.arange(30.0)
    table = small_table(y, status=["ok"] * 29 + ["failed"], **{EVIL: y, "c": [EVIL, "b"] * 15})
    table = dataclasses.replace(
        table, name=EVIL, outcomes={EVIL: y}, reason=np.array([""] * 29 + [EVIL], dtype=object)
    )
    made = page.write_report(table, tmp_path / "<b>", "c").read_text(encoding="utf-8")
    assert EVIL not in made and "<b onload" not in made
    assert made.count("</script>") == 1


@pytest.mark.parametrize("status", ["ok", "failed"])
def test_a_study_with_little_to_show(tmp_path, status):
    table = small_table(np.full(3, np.nan), status=[status] * 3, x=np.arange(3.0))
    path = page.write_report(table, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]
    text = text_of(path)
    assert "3 runs" in text and f"3 {status}" in text and "What we found" not in text
    assert show.summary_tables(table)[1:] == []


def test_nothing_varies_and_all_is_known(tmp_path):
    path = page.write_report(small_table(np.arange(3.0)), tmp_path)
    assert (tmp_path / "distributions.svg").exists() and not (tmp_path / "tornado.svg").exists()
    assert "95 % of the runs stay below 1.9" in text_of(path)


def test_bad_input(table, tmp_path):
    with pytest.raises(InputError, match="no input 'mass'"):
        page.write_report(table, tmp_path, "mass")
    (tmp_path / "file").write_text("x", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be written"):
        page.write_report(table, tmp_path / "file")


@pytest.mark.parametrize(("width", "dark"), [(390, False), (1280, True)])
def test_in_a_browser(report, width, dark):
    with open_page(report, width=width, dark=dark) as (tab, errors, requests):
        assert tab.evaluate("document.documentElement.scrollWidth") == width
        assert tab.locator("figure svg").count() == 4
        before = tab.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (min(map(int, re.findall(r"\d+", before))) < 128) == dark
        tab.locator("#theme").click()
        assert tab.evaluate("getComputedStyle(document.body).backgroundColor") != before
        tab.locator("details summary").first.click()
        assert tab.locator("details table:visible").count() > 0
        assert tab.evaluate("document.documentElement.scrollWidth") == width
        assert errors == [] and requests == []


def test_figures_in_the_page_are_small_pictures(folder):
    for path in folder.glob("*.svg"):
        assert path.stat().st_size < 3e6
        assert ElementTree.parse(path).getroot().get("viewBox")
