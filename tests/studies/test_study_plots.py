"""Figures of a study: panels, units, groups; nothing cut off, nothing on top of each other."""

from __future__ import annotations

import dataclasses
import math
from itertools import combinations

import numpy as np
import pytest
from figures import legend_texts
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import same_color, to_hex
from synthetic import CONTROLLERS, make_table, small_table

from sdt_drake.show.figures import fronts as plots_front
from sdt_drake.show.figures import studies as plots
from sdt_drake.show.style import LOOKS, PALETTE

FAMILIES = ("max_abs_speed_error", "max_abs_position_error", "peak_torque_share", "felt_share")
INPUTS = ("omega_r", "payload", "friction", "motion")


@pytest.fixture(scope="module")
def table():
    return make_table(60)


@pytest.fixture(scope="module")
def figures(table):
    return {
        "distributions": plots.distributions("title", table, FAMILIES),
        "tornado": plots.tornado_figure("title", table, "max_abs_position_error"),
        "scatter": plots.scatter_matrix("title", table, INPUTS, FAMILIES),
    }


def panels(figure):
    return [ax for ax in figure.axes if ax.axison]


@pytest.mark.parametrize("name", ["distributions", "scatter"])
def test_nothing_is_cut_and_panels_keep_apart(figures, name):
    figure = figures[name]
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    boxes = [ax.get_tightbbox(renderer) for ax in panels(figure)]
    boxes += [figure.legends[0].get_window_extent(renderer), figure._suptitle.get_window_extent()]
    whole = figure.bbox.padded(1)
    assert all(whole.contains(*box.p0) and whole.contains(*box.p1) for box in boxes)
    assert not any(
        min(a.x1, b.x1) - max(a.x0, b.x0) > 3 and min(a.y1, b.y1) - max(a.y0, b.y0) > 3
        for a, b in combinations(boxes, 2)
    )


def test_distributions_have_a_panel_for_each_joint_and_a_line_for_each_controller(figures, table):
    shown = panels(figures["distributions"])
    assert [ax.get_title(loc="left") for ax in shown] == [
        *(f"joint {k}" for _ in range(3) for k in (1, 2, 3, 4)),
        "the whole device",
    ]
    assert legend_texts(figures["distributions"]) == [*CONTROLLERS, "50 %", "95 %", "99 %"]
    curve, *marks = shown[5].lines[:4]
    assert shown[5].get_xscale() == "log" and shown[8].get_xscale() == "linear"
    first = np.degrees(table.groups["pi"].outcomes["max_abs_position_error_2"])
    ordered = np.sort(first[np.isfinite(first)])
    assert curve.get_xdata()[[0, -1]] == pytest.approx(ordered[[0, -1]])
    for p, mark in zip((50, 95, 99), marks, strict=True):  # least that so many do not exceed
        least = ordered[math.ceil(p / 100 * len(ordered)) - 1]
        assert [*mark.get_xdata(), *mark.get_ydata()] == [pytest.approx(least), p]


def test_tornado_has_a_row_for_each_controller_and_the_longest_bars_on_top(figures, table):
    shown = panels(figures["tornado"])
    titles = [ax.get_title(loc="left") for ax in shown[:8:4]]
    assert titles == ["pi, joint 1", "pi_id, joint 1"]
    ax, part = shown[0], table.groups["pi"]
    assert [x.get_text() for x in ax.get_yticklabels()][:2] == ["omega_r", "payload"]
    omega = [bar for bar in ax.patches if round(bar.get_y() + bar.get_height() / 2) == 0]
    ends = {to_hex(bar.get_facecolor()).upper(): bar.get_x() + bar.get_width() for bar in omega}
    ok = part.select(part.ok)
    x, y = ok.inputs["omega_r"], np.degrees(ok.outcomes["max_abs_position_error_1"])
    assert ends[plots.LOW] == pytest.approx(y[x <= np.quantile(x, 0.2)].mean())
    assert ends[plots.LOW] > y.mean() > ends[plots.HIGH]


def test_scatter_matrix_has_an_outcome_in_each_row_and_an_input_in_each_column(figures, table):
    shown = panels(figures["scatter"])
    assert len(shown) == 16
    assert [ax.get_xlabel() for ax in shown[-4:]] == list(INPUTS)
    assert shown[4].get_ylabel() == "largest position\nerror,\nworst joint\n[deg]"
    (points,) = shown[4].collections
    by_x = dict(points.get_offsets().tolist())
    assert points.get_rasterized() and len(points.get_offsets()) == table.ok.sum()
    worst = np.degrees(table.outcome("max_abs_position_error"))
    assert by_x[table.inputs["omega_r"][0]] in worst[:3]
    colours = {to_hex(c, keep_alpha=False).upper() for c in points.get_facecolors()}
    assert colours == {LOOKS[label].colour for label in CONTROLLERS}


def test_pareto_front_is_a_line_and_the_rest_is_grey():
    """Of designs by the worst of their motions; one that cannot do a motion is out."""
    y = np.array([4.0, 2.0, 3.0, 1.0, 9.0])
    y = np.concatenate([y, 0.5 * y, [0.1, 0.1]])
    cost = [1.0, 2.0, 2.5, 3.0, np.nan]
    table = dataclasses.replace(
        small_table(
            y,
            status=11 * ["ok"] + ["infeasible"],
            kind=list("ababa") * 2 + ["a", "a"],
            size=[*range(5), *range(5), 6, 6],
            motion=5 * ["far"] + 5 * ["near"] + ["far", "near"],
        ),
        outcomes={"cost": np.array([*cost, *cost, 0.1, 0.1]), "error": y},
        choices=("kind", "size"),
    )
    figure = plots_front.pareto_figure("title", table, "cost", "error")
    (ax,) = figure.axes
    np.testing.assert_array_equal(ax.lines[0].get_xydata(), [[1, 4], [2, 2], [3, 1]])
    rest_a, best_a, rest_b, best_b = ax.collections
    np.testing.assert_array_equal(rest_a.get_offsets(), [[2.5, 3]])
    np.testing.assert_array_equal(best_a.get_offsets(), [[1, 4]])
    assert len(rest_b.get_offsets()) == 0
    np.testing.assert_array_equal(best_b.get_offsets(), [[2, 2], [3, 1]])
    assert same_color(rest_a.get_facecolor()[0], "0.75")
    assert same_color(best_b.get_facecolor()[0], PALETTE[1])
    assert legend_texts(figure)[:2] == ["kind a", "kind b"]
