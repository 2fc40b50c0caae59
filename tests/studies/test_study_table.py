"""The table of a study: designs and their front, statistics against closed forms, and reports."""

import dataclasses
import re
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from synthetic import make_table, small_table, table_of

from sdt_drake.analysis.metrics import METRICS, family_of, metric_of
from sdt_drake.show.documents import render
from sdt_drake.show.figures import studies as plots
from sdt_drake.show.reports import study as report
from sdt_drake.studies import results
from sdt_drake.studies.distributions import Uniform
from sdt_drake.studies.sizing import load_sizing
from sdt_drake.studies.study import Study, Variable
from sdt_drake.studies.summary import (
    explained_share,
    percentiles,
    sensitivity,
    tornado,
    worst_runs,
)
from sdt_drake.studies.table import pareto


def test_a_family_stands_for_the_worst_joint_that_has_a_number():
    columns = np.array([[1.0, np.nan, np.nan], [np.nan, 2.0, np.nan], [0.5, 3.0, np.nan]])
    names = [f"rms_speed_error_{k}" for k in (1, 2, 4)]
    table = table_of({}, dict(zip(names, columns, strict=True)))
    np.testing.assert_array_equal(table.outcome("rms_speed_error"), [1, 3, np.nan])
    np.testing.assert_array_equal(table.worst_joint("rms_speed_error")[:2], [1, 4])
    assert table.outcome(names[1]) is table.outcomes[names[1]]


def test_every_family_has_title_and_unit():
    for name, quantity in METRICS.items():
        assert family_of(f"{name}_2") == (name, 2) and family_of(name) == (name, None)
        assert metric_of(f"{name}_12") is quantity
    assert metric_of("max_abs_position_error_1").factor == pytest.approx(180 / np.pi)
    assert metric_of("peak_torque_share_1").factor == 100


def test_what_a_designer_chooses():
    """Devices at random are not designs; motions are what designs have to stand."""
    for field in ("plant.friction.coulomb", "drive.torque_error[2]", "controller.model.coulomb"):
        by_chance = Variable("", [field], distribution=Uniform(-0.1, 0.1))
        assert results._choices(Study("s", variables=[by_chance])) is None
    sizing, _ = load_sizing("package://sdt/studies/sizing.yaml")
    motors = [f"motor_{k}" for k in (1, 2, 3, 4)]
    assert results._choices(sizing.study()) == (*motors, "structure_scale", "controller")


def test_a_design_is_as_good_as_the_worst_of_its_runs_and_out_if_one_failed():
    table = table_of(
        {"kind": np.array(list("abcabc")), "motion": np.array(["far"] * 3 + ["near"] * 3)},
        {"cost": np.array([1.0, 2, 3, 1, 4, 3]), "error": np.array([5.0, 6, 7, 6, 5, 0])},
        ["ok"] * 5 + ["infeasible"],
        choices=("kind",),
    )
    first, worst = table.designs("cost", "error")
    assert first.tolist() == [0, 1] and np.array(worst).tolist() == [[1, 4], [6, 6]]


@pytest.mark.parametrize(
    ("cost", "error", "expected"),
    [
        ([1, 2, 3, 4, 2, 5], [9, 5, 6, 1, 7, 1], [1, 1, 0, 1, 0, 0]),
        ([1, 1, 2, 2], [3, 3, 3, 3], [1, 1, 0, 0]),  # equal points are on it together
        ([0, np.nan, 2, np.inf], [np.nan, 0, 5, 1], [0, 0, 1, 1]),
    ],
)
def test_a_front_by_hand(cost, error, expected):
    assert pareto(cost, error).tolist() == list(map(bool, expected))


# --- counts and percentiles ------------------------------------------------------------------


def test_percentiles_and_worst_runs_are_of_the_runs_that_are_ok():
    y = np.array([*range(101), 1e9, np.nan])
    table = small_table(y, status=["ok"] * 101 + ["failed", "ok"])
    np.testing.assert_allclose(percentiles(table, "y"), [5, 25, 50, 75, 95, 99, 100])
    assert list(worst_runs(table, "y", 3).row) == [100, 99, 98]
    assert list(worst_runs(small_table([1, 2, 2, np.nan]), "y", 9).row) == [1, 2, 0]


# --- what matters ----------------------------------------------------------------------------


@pytest.fixture
def generator():
    return np.random.default_rng(3)


def test_the_ishigami_function(generator):
    """Ishigami and Homma, 1990, with a = 7, b = 0.1: first-order indices in closed form."""
    x = generator.uniform(-np.pi, np.pi, (20_000, 3))
    y = np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    v1, v2 = 0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2, 7**2 / 8
    total = 7**2 / 8 + 0.1 * np.pi**4 / 5 + 0.1**2 * np.pi**8 / 18 + 0.5
    found = [explained_share(x[:, k], y).value for k in range(3)]
    assert found == pytest.approx([v1 / total, v2 / total, 0], abs=0.015)


@pytest.mark.parametrize("levels", [None, 12], ids=["numbers", "texts"])
def test_noise_explains_nothing_on_average(generator, levels):
    def draw():
        return generator.integers(levels, size=100).astype(str) if levels else generator.random(100)

    shares = [explained_share(draw(), generator.normal(size=100)) for _ in range(200)]
    shares, errors = np.array(shares).T
    # They say how far chance takes the share, a little more where groups are small.
    assert 0.8 * np.std(shares) < np.sqrt(np.mean(errors**2)) < 1.8 * np.std(shares)
    assert np.mean(shares) == pytest.approx(0, abs=4 * np.std(shares) / np.sqrt(200))


@pytest.mark.parametrize(("draws", "levels"), [(20, 20), (100, 4)])
def test_runs_of_one_draw_are_one_sample_of_what_is_drawn(generator, draws, levels):
    """y = x + g, with z drawn beside x, and each draw run at every level of g: z explains nothing,
    and neither takes the variance of g for its own."""
    g = np.tile(np.arange(levels) / levels, draws)
    exact = 1 / 12 / (1 / 12 + np.var(g))
    found = []
    for _ in range(50):
        x, z = generator.uniform(size=(2, draws)).repeat(levels, axis=1)
        table = dataclasses.replace(small_table(x + g, x=x, z=z, g=g), per_draw=levels)
        found.append([sensitivity(table, "y")[name] for name in "xzg"])
    values, errors = np.moveaxis(np.array(found), -1, 0)
    assert np.mean(values[:, 1]) == pytest.approx(0, abs=4 * np.std(values[:, 1]) / np.sqrt(50))
    assert np.mean(values[:, 0]) == pytest.approx(exact, abs=0.08)  # what few bins lose
    assert np.mean(values[:, 2]) == pytest.approx(1 - exact, abs=0.02)
    assert np.all(0.7 * values.std(axis=0)[:2] < errors.mean(axis=0)[:2])


@pytest.mark.parametrize(("rows", "columns"), [(2, 2), (20, 3)])
def test_in_a_full_grid_nothing_is_chance(rows, columns):
    """Less than chance would have given, 5 by 5 equal inputs explained 40 ± 14 % each."""
    x, z = (grid.ravel() for grid in np.indices((rows, columns)))
    y = 3.0 * x + np.sin(z)
    for one, own in ((x, 3.0 * x), (z.astype(str), np.sin(z))):
        share = explained_share(one, y, np.zeros(len(y), dtype=int))
        assert share == pytest.approx((np.var(own) / np.var(y), 0), rel=1e-12)


def test_a_tornado_is_of_the_outer_fifths_of_numbers_and_of_the_levels_of_texts():
    x = np.arange(1000.0)
    swing, nothing = tornado(small_table(x, z=np.tile([0.0, 1.0], 500), x=x), "y")
    assert (swing.name, swing.low, swing.high, swing.low_level) == ("x", 99.5, 899.5, "")
    assert nothing.name == "z" and nothing.width == pytest.approx(1)
    (swing,) = tornado(small_table([1, 5, 3, 2, 6, 3], c=list("abcabc")), "y")
    assert (swing.low_level, swing.low, swing.high_level, swing.high) == ("a", 1.5, "b", 5.5)


# --- report and figures ----------------------------------------------------------------------


@pytest.mark.parametrize("status", ["ok", "failed"])
def test_a_study_with_little_to_show(tmp_path, status):
    table = small_table(np.full(3, np.nan), status=[status] * 3, x=np.arange(3.0))
    document, tables = report.make_study_report(table, tmp_path)
    assert list(tmp_path.iterdir()) == [] and len(tables) == 1
    assert ("3 of 3 runs failed" in document.page()) == (status == "failed")


def test_a_study_that_is_not_done_has_no_pareto_front(tmp_path, undrawn):
    """Of a design that looks good the worst run may be to come."""
    part = dataclasses.replace(make_table(5, joints=1), missing=1)
    report.make_study_report(part, tmp_path, tmp_path)
    assert {path.stem for path in tmp_path.iterdir()} == {*report.FIGURES} - {"pareto"}


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
