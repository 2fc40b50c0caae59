"""The figure that compares controllers."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from figures import line, shown_ticks
from matplotlib.colors import same_color

from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.tracking import MotorUse, Tracking
from sdt_drake.show.figures import runs as plots

NAMES = ("base", "elbow", "wrist")
LABELS = ("pi", "p_pi+id", "inverse_dynamics")
SHARES = (1.0, 0.1, 0.004)
TORQUES = ("rms_share", "peak_share")
CONSTANT = np.array([0.02, np.nan, 0.04])


def make_compared(labels, shares, *, head=True):
    """Controllers whose errors are these shares; the second joint has no constant speed."""
    plant = SimpleNamespace(HasFrameNamed=lambda name: head)
    robot, made = SimpleNamespace(joint_names=NAMES, plant=plant), []
    for label, share in zip(labels, shares, strict=True):
        row = share * np.array([0.1, 0.2, 0.3])
        tracking = Tracking(row, row / 3, share * CONSTANT, 0 * row, np.radians(row))
        motors = MotorUse(row, row, 2 * row, row)
        made.append(Compared(label, SimpleNamespace(robot=robot), None))
        vars(made[-1]).update(tracking=tracking, motors=motors)  # as if computed already
        if head:
            vars(made[-1])["head"] = SimpleNamespace(felt=SimpleNamespace(share=share))
    return made


@pytest.fixture(scope="module")
def compared():
    """Three controllers."""
    return make_compared(LABELS, SHARES)


@pytest.fixture(scope="module")
def figure(compared):
    return plots.comparison("comparison", compared)


def test_has_a_dot_or_a_bar_for_each_controller_and_joint(figure, compared):
    errors = (
        [c.tracking.max_abs_speed_error for c in compared],
        [c.tracking.rms_speed_error for c in compared],
        [c.tracking.constant_speed_error for c in compared],
        [np.degrees(c.tracking.max_abs_position_error) for c in compared],
    )
    torques = ([100 * getattr(c.motors, name) for c in compared] for name in TORQUES)
    for ax, rows in zip(figure.axes[:4], errors, strict=True):
        dots = [line(ax, label) for label in LABELS]
        assert not ax.containers and [dot.get_linestyle() for dot in dots] == ["None"] * 3
        for dot, expected in zip(dots, rows, strict=True):
            np.testing.assert_allclose(dot.get_ydata(), expected)
        places = np.array([dot.get_xdata() for dot in dots])
        assert np.abs(places - np.arange(3)).max() < 0.5 and np.diff(places, axis=0).min() > 0
    for ax, rows in zip(figure.axes[4:6], torques, strict=True):
        assert [c.get_label() for c in ax.containers] == list(LABELS)
        for bars, expected in zip(ax.containers, rows, strict=True):
            np.testing.assert_allclose([bar.get_height() for bar in bars], expected)
        edges = sorted((bar.get_x(), bar.get_x() + bar.get_width()) for bar in ax.patches)
        assert all(a[1] <= b[0] + 1e-9 for a, b in pairwise(edges))


def test_says_where_there_is_nothing_to_compare(figure):
    """A joint without constant speed, and errors that are 0, have no dot."""
    constant = figure.axes[2]
    assert [(t.get_position()[0], t.get_text()) for t in constant.texts] == [(1, "not\napplicable")]
    none = plots.comparison("none", make_compared(LABELS, (0, 0, 0), head=False))
    texts = [[t.get_text() for t in ax.texts] for ax in none.axes]
    assert texts[0] == 3 * ["none"] and texts[2] == ["none", "not\napplicable", "none"]


def test_of_errors_is_logarithmic_and_that_of_torques_starts_at_zero(figure):
    axes = figure.axes
    assert [ax.get_yscale() for ax in axes] == 4 * ["log"] + 3 * ["linear"]
    assert [ax.get_ylim()[0] for ax in axes[4:]] == [0, 0, 0]


def test_shows_what_could_be_felt(figure):
    *others, ax = figure.axes
    assert ax.get_title(loc="left") == "error that can be felt [% of time]"
    assert [bar.get_height() for bar in ax.patches] == pytest.approx([100, 10, 0.4])
    assert [text.get_text() for text in ax.texts] == ["100.0", "10.0", "0.4"]
    names = [label.get_text().replace("\n", "") for label in ax.get_xticklabels()]
    assert names == list(LABELS)
    for bar, label in zip(ax.patches, LABELS, strict=True):
        assert same_color(bar.get_facecolor(), line(others[0], label).get_color())


def test_without_a_head_has_no_panel_for_it(figure):
    headless = plots.comparison("headless", make_compared(LABELS, SHARES, head=False))
    assert len(headless.axes) == 6 == len(figure.axes) - 1
    assert headless.get_figheight() < figure.get_figheight()


def test_powers_of_ten_are_written_out(figure):
    assert {"0.001", "0.01", "0.1"} <= shown_ticks(figure.axes[0].yaxis)
