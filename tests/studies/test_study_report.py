"""What `sdt-drake study show` prints and draws, and report.html of a study."""

from __future__ import annotations

import dataclasses
import math
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from synthetic import CONTROLLERS, make_table, small_table

from sdt_drake.show.documents import render
from sdt_drake.show.reports import study as report


@pytest.fixture(scope="module")
def table():
    return make_table(60, joints=2)


@pytest.fixture(scope="module")
def folder(once):
    """Where report and figures are: a path with a space."""
    return once("my results", lambda folder: folder)


@pytest.fixture(scope="module")
def made(table, folder, once):
    """Report and tables; the figures are in the folder; do not change it."""
    return once("study_report", lambda _: report.make_study_report(table, folder))


def text_of(document):
    parser, texts = HTMLParser(), []
    parser.handle_data = texts.append
    parser.feed(document.page())
    return re.sub(r"\s+", " ", " ".join(texts))


def finding(table, family):
    """The sentence on a family of outcomes."""
    study = report.study_summary(table) | {"findings": [report.finding(table, family)]}
    (said,) = re.findall("^- (.*)$", render("study_summary.md.j2", study=study), re.MULTILINE)
    return said


# --- tables ----------------------------------------------------------------------------------


def test_tables_are_rectangular_and_of_texts(made):
    _, tables = made
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
    for one in tables:
        assert one.rows and {len(row) for row in one.rows} == {len(one.header)}
        assert all(isinstance(cell, str) for row in (one.header, *one.rows) for cell in row)


def test_status_table(table):
    assert report.status_table(table).rows == [
        ["ok", "176", "97.8", "", ""],
        ["infeasible", "4", "2.2", "", ""],
        ["", "4", "", "7", "joint 2 needs … N m, expected at most 90 N m"],
    ]


def test_percentile_table_is_in_the_unit_of_its_title(table):
    names = ["max_abs_position_error", "max_abs_position_error_2"]
    made = report.percentile_table(table, names)
    assert made.title.endswith("[deg]")
    assert made.header == ["controller", "5 %", "25 %", "50 %", "75 %", "95 %", "99 %", "largest"]
    assert [row[0] for row in made.rows[:2]] == ["pi, worst joint", "pi, joint 2"]
    part = table.groups["pi"]
    largest = np.degrees(np.nanmax(part.outcomes["max_abs_position_error_2"]))
    assert made.rows[1][-1] == f"{largest:.4g}"


def test_worst_table_names_run_joint_and_inputs(table):
    made = report.worst_table(table, "max_abs_speed_error", count=2)
    inputs = ["controller", "omega_r", "payload", "friction", "motion"]
    assert made.header == ["row", "joint", "rad/s", *inputs]
    labels = [row[3] for row in made.rows]
    assert labels == ["pi", "pi", "pi_id", "pi_id", "p_pi+id", "p_pi+id"]
    row, joint, value, _, omega_r, *_ = made.rows[0]
    assert (joint, value) == ("2", f"{table.outcomes['max_abs_speed_error_2'][int(row)]:.4g}")
    assert omega_r == f"{table.inputs['omega_r'][int(row)]:.4g}"
    assert "joint" not in report.worst_table(table, "felt_share").header


def test_sensitivity_table(table):
    families = ["max_abs_speed_error", "saturated_fraction"]
    made = report.sensitivity_tables(table, families)[0]
    assert made.header == ["input", "largest speed error", "saturation"]
    names = [row[0] for row in made.rows]
    assert names[:2] == ["omega_r", "payload"] and names[-1] == "sum"
    assert [row[2] for row in made.rows] == ["–"] * 5  # it is 0 in all runs
    shares, errors = np.array([row[1].split(" ± ") for row in made.rows[:-1]], dtype=float).T
    assert float(made.rows[-1][1]) == pytest.approx(sum(shares), abs=3) and min(shares) >= 0
    assert np.all((errors > 0) & (errors < 25))
    one = small_table(np.arange(20.0) ** 2, x=np.arange(20.0), c=["a", "b"] * 10)
    assert report.sensitivity_tables(one, ["y"]) == []  # there is nothing to apportion
    assert "varies most" not in finding(one, "y")


@pytest.mark.parametrize(
    ("inputs", "by"),
    [
        ({"controller": ["pi", "p_pi"] * 5, "a": ["x", "y"] * 5}, "controller"),
        ({"a": ["x", "y"] * 5, "controller": ["pi"] * 10}, "a"),
        ({"a": [str(i) for i in range(10)], "b": np.arange(10.0)}, None),
    ],
)
def test_the_controllers_are_told_apart_where_there_are_some(inputs, by):
    assert small_table(np.arange(10.0), **inputs).by == by


def test_levels_that_do_not_speak_for_themselves_are_said_of_what(table):
    """Lines of a figure were called "true" and "false", and a structure like a controller, "pi"."""
    inputs = {"controller.structure": ["pi", "p_in_feedback"] * 5}
    structures = small_table(np.arange(10.0), **inputs)
    assert list(structures.groups) == ["structure pi", "structure p_in_feedback"]
    assert [part.row.tolist() for part in structures.groups.values()] == [
        [*range(0, 10, 2)],
        [*range(1, 10, 2)],
    ]
    assert "with `structure pi` and 9 with `structure p_in_feedback`" in finding(structures, "y")


def test_a_finding_names_the_limit_and_the_cause(table):
    text = finding(table, "max_abs_position_error")
    pi = table.groups["pi"]
    values = np.sort(np.degrees(pi.outcome("max_abs_position_error")[pi.ok]))
    limit = values[math.ceil(0.95 * len(values)) - 1]
    start = "**Largest position error [deg], worst joint:** at most "
    assert text.startswith(f"{start}{limit:.3g} with `pi`")
    assert "in 95 % of the runs with a value" in text
    assert re.search(r"It depends most on `omega_r` \(\d+ ± \d+ % with `pi`", text)
    alone = finding(small_table(np.arange(20.0)), "y")
    assert alone == "**Y:** at most 18 in 95 % of the runs."


# --- page ------------------------------------------------------------------------------------


def test_page_and_figures(made, folder):
    document, _ = made
    assert {path.name for path in folder.iterdir()} == {
        f"{name}.{suffix}" for name in report.FIGURES for suffix in ("png", "svg")
    }
    for path in folder.glob("*.svg"):
        assert path.stat().st_size < 3e6
    text = text_of(document)
    assert "180 runs that differ in omega_r" in text and "90.0 s of computation" in text
    assert "176 ok 4 infeasible" in text
    assert f"sdt-drake study repeat '{folder}' --row N" in text
    captions = re.findall(r"!\[(.*)\]\((\w+)\.png\)", document.markdown)
    assert {name for _, name in captions} == set(report.FIGURES)
    for caption, _ in captions:
        assert caption in text
    _, saturation = document.markdown.split("<summary>Saturation</summary>\n\n")[:2]
    named = re.findall(r"^\| ([^|]*) \|", saturation.split("\n\n</details>")[0], re.MULTILINE)
    assert named[2:5] == ["pi, worst joint", "pi, joint 1", "pi, joint 2"]


def test_the_page_is_the_same_each_time(tmp_path):
    y = np.arange(30.0)
    table = small_table(y, x=y, c=["a", "b"] * 15)
    one, two = (report.make_study_report(table, tmp_path)[0].page() for _ in range(2))
    assert one == two


@pytest.mark.parametrize("status", ["ok", "failed"])
def test_a_study_with_little_to_show(tmp_path, status):
    table = small_table(np.full(3, np.nan), status=[status] * 3, x=np.arange(3.0))
    document, tables = report.make_study_report(table, tmp_path)
    assert list(tmp_path.iterdir()) == [] and len(tables) == 1
    text = text_of(document)
    assert "3 runs" in text and f"3 {status}" in text and "in 95 %" not in text
    assert ("3 of 3 runs failed" in text) == (status == "failed")


def test_a_study_that_is_not_done_has_no_pareto_front(tmp_path, undrawn):
    """Of a design that looks good the worst run may be to come."""
    table = make_table(10, joints=1)
    for missing in (1, 0):
        part = dataclasses.replace(table, missing=missing)
        report.make_study_report(part, tmp_path, tmp_path)
        assert (tmp_path / "pareto.svg").exists() is not bool(missing)


def test_nothing_varies_and_all_is_known(tmp_path, undrawn):
    study = tmp_path / "study"
    document, _ = report.make_study_report(small_table(np.arange(3.0)), study, tmp_path)
    assert not study.exists() and f"study repeat {study} --row N" in text_of(document)
    assert (tmp_path / "distributions.svg").exists() and not (tmp_path / "tornado.svg").exists()
    assert "at most 2 in 95 % of the runs." in text_of(document)


def test_a_chapter_has_what_matters_most(copied, undrawn):
    chapter = report.study_chapter(copied)
    text = render("study_chapter.md.j2", study=chapter)
    assert text.startswith("## Study many\n") and text.count("\n| --- |") == 1
    assert " runs that differ in" in text and (copied / "tornado.svg").exists()
    for name in re.findall(r"\]\((.*)\.png\)", text):  # as seen from the folder above
        assert (copied.parent / f"{name}.svg").is_file()


def test_in_a_browser(open_page, made, tmp_path):
    path = tmp_path / "report.html"
    path.write_text(made[0].page(), encoding="utf-8")
    with open_page(path, width=390) as (tab, errors, requests):
        assert tab.evaluate("document.documentElement.scrollWidth") == 390
        assert tab.locator("figure img").count() == 4
        tab.locator("details summary").first.click()
        assert tab.locator("details table:visible").count() > 0
        assert tab.evaluate("document.documentElement.scrollWidth") == 390
        assert errors == [] and requests == []
