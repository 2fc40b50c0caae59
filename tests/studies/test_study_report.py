"""Report and figures of a study, beside what the gallery and the table of commands show."""

from __future__ import annotations

import dataclasses
import re
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from synthetic import make_table, small_table

from sdt_drake.show.documents import render
from sdt_drake.show.figures import studies as plots
from sdt_drake.show.reports import study as report


@pytest.mark.parametrize("status", ["ok", "failed"])
def test_a_study_with_little_to_show(tmp_path, status):
    table = small_table(np.full(3, np.nan), status=[status] * 3, x=np.arange(3.0))
    document, tables = report.make_study_report(table, tmp_path)
    assert list(tmp_path.iterdir()) == [] and len(tables) == 1
    assert ("3 of 3 runs failed" in document.page()) == (status == "failed")


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
    for name in re.findall(r"\]\((.*)\.png\)", text):  # as seen from the folder above
        assert (copied.parent / f"{name}.svg").is_file()


def test_nothing_of_a_figure_is_cut_and_panels_keep_apart():
    families = ("max_abs_speed_error", "max_abs_position_error", "peak_torque_share", "felt_share")
    inputs = ("omega_r", "payload", "friction", "motion")
    table = make_table(20, joints=2)
    for figure in (
        plots.distributions("title", table, families),
        plots.scatter_matrix("title", table, inputs, families),
    ):
        renderer = FigureCanvasAgg(figure).get_renderer()
        figure.draw(renderer)
        boxes = [ax.get_tightbbox(renderer) for ax in figure.axes if ax.axison]
        boxes += [figure.legends[0].get_window_extent(renderer)]
        boxes += [figure._suptitle.get_window_extent()]
        whole = figure.bbox.padded(1)
        assert all(whole.contains(*box.p0) and whole.contains(*box.p1) for box in boxes)
        assert not any(
            min(a.x1, b.x1) - max(a.x0, b.x0) > 3 and min(a.y1, b.y1) - max(a.y0, b.y0) > 3
            for a, b in combinations(boxes, 2)
        )
