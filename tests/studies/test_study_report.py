"""What `sdt-drake study show` prints and draws, and report.html of a study."""

from __future__ import annotations

import dataclasses
import math
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from synthetic import make_table, small_table

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
    assert tables[0].title == "Runs by status" and tables[0].rows == [
        ["ok", "176", "97.8", "", ""],
        ["infeasible", "4", "2.2", "", ""],
        ["", "4", "", "7", "joint 2 needs … N m, expected at most 90 N m"],
    ]
    for one in tables:
        assert one.rows and {len(row) for row in one.rows} == {len(one.header)}
        assert all(isinstance(cell, str) for row in (one.header, *one.rows) for cell in row)
    shares, *_ = (one for one in tables if one.title.startswith("Variance"))
    assert [row[0] for row in shares.rows][:2] == ["omega_r", "payload"]
    named = [float(row[1].split(" ± ")[0]) for row in shares.rows]
    assert named[-1] == pytest.approx(sum(named[:-1]), abs=3) and min(named) >= 0


def test_worst_table_names_run_joint_and_inputs(table):
    made = report.worst_table(table, "max_abs_speed_error", count=2)
    labels = [row[3] for row in made.rows]
    assert labels == ["pi", "pi", "pi_id", "pi_id", "p_pi+id", "p_pi+id"]
    row, joint, value, _, omega_r, *_ = made.rows[0]
    assert (joint, value) == ("2", f"{table.outcomes['max_abs_speed_error_2'][int(row)]:.4g}")
    assert omega_r == f"{table.inputs['omega_r'][int(row)]:.4g}"
    assert "joint" not in report.worst_table(table, "felt_share").header


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
    text = text_of(document)
    assert "180 runs that differ in omega_r" in text and "90.0 s of computation" in text
    assert "176 ok 4 infeasible" in text
    assert f"sdt-drake study repeat '{folder}' --row N" in text
    captions = re.findall(r"!\[(.*)\]\((\w+)\.png\)", document.markdown)
    assert {name for _, name in captions} == set(report.FIGURES)
    for caption, _ in captions:
        assert caption in text


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
    for missing in (1, 0):
        part = dataclasses.replace(make_table(5, joints=1), missing=missing)
        report.make_study_report(part, tmp_path, tmp_path)
        assert (tmp_path / "pareto.svg").exists() is not bool(missing)


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
        assert errors == [] and requests == []
