"""Figures: panels, labels, colours, and files."""

import dataclasses
from itertools import combinations, pairwise
from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure

from sdt_drake.analysis import plots
from sdt_drake.analysis.budget import ErrorBudget
from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.frequency_response import FrequencyResponse
from sdt_drake.analysis.stability import StabilitySweep
from sdt_drake.analysis.study import StepResponse
from sdt_drake.analysis.tracking import MotorUse, Tracking
from sdt_drake.control import step_metrics
from sdt_drake.dynamics import Loads
from sdt_drake.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.simulate import Recording

PERIOD = 0.01
NAMES = ("base", "elbow", "wrist")
# Okabe and Ito's blue, vermilion and bluish green, for the paper's: reference, PI, PI + CTC.
BLUE, RED, GREEN = "#0072B2", "#D55E00", "#009E73"


@pytest.fixture(scope="module")
def motion():
    """Joint 1 at constant speed, joint 2 at rest, joint 3 accelerating; 3 s."""
    t = np.arange(301) * PERIOD
    v = np.stack([np.full_like(t, 0.5), np.zeros_like(t), 0.1 * t**2], axis=1)
    return Motion.from_speeds(PERIOD, np.array([0.0, 0.2, 0.4]), v)


def make_recording(motion, error):
    v = motion.v + error
    torque = np.cumsum(np.ones_like(v), axis=0) / 100
    return Recording(
        time=motion.time,
        q_ref=motion.q,
        v_ref=motion.v,
        q=motion.q,
        v=v,
        tau_cmd=torque,
        tau_limited=torque / 2,
        tau=torque / 2,
        load_torque=-torque,
        tau_peak=torque / 2,
        tau_rms=torque / 2,
        saturated=0 * torque,
        beyond_stop=0 * torque,
    )


@pytest.fixture(scope="module")
def runs(motion):
    return {
        "PI": make_recording(motion, -0.123),
        "PI + CTC": make_recording(motion, np.array([0.011, -0.022, 0.033])),
        "PI + CTC, printed sign": make_recording(motion, 0.4),
    }


@pytest.fixture(scope="module")
def steps():
    t = np.linspace(0, 0.5, 1001)
    speeds = {
        "pi": 1 - np.exp(-30 * t) * np.cos(40 * t),
        "p_in_feedback": 1 - np.exp(-20 * t),
    }
    return {
        name: StepResponse(name, zeta, t, y, step_metrics(t, y, y0=0.0, y_final=1.0))
        for (name, y), zeta in zip(speeds.items(), (1.0, 0.95), strict=True)
    }


LABELS = ("pi", "p_pi+id", "inverse_dynamics")
SHARES = (1.0, 0.1, 0.004)
CONSTANT = np.array([0.02, np.nan, 0.04])


def headless_robot(names=NAMES):
    return SimpleNamespace(
        joint_names=names, plant=SimpleNamespace(HasFrameNamed=lambda name: False)
    )


def make_compared(labels, shares, *, head=True):
    """Controllers whose errors are these shares; the second joint has no constant speed."""
    robot, made = headless_robot(), []
    for label, share in zip(labels, shares, strict=True):
        row = share * np.array([0.1, 0.2, 0.3])
        tracking = Tracking(row, row / 3, share * CONSTANT, 0 * row, np.radians(row))
        motors = MotorUse(row, row, 2 * row, row)
        made.append(Compared(label, SimpleNamespace(robot=robot), None, tracking, motors, 9, ()))
        if head:  # as if it were computed already
            vars(made[-1])["head"] = SimpleNamespace(felt=SimpleNamespace(share=share))
    return made


@pytest.fixture(scope="module")
def compared():
    """Three controllers."""
    return make_compared(LABELS, SHARES)


@pytest.fixture(scope="module")
def budget(motion):
    t = motion.time[:, None] * np.array([1.0, 2.0, 3.0])
    parts = {
        "reference lag": -0.2 * t,
        "load": 0.1 * t,
        "disturbance": 0 * t,
        "saturation": 0.02 * t**2,
    }
    remainder = 0.01 * np.sin(t)
    return ErrorBudget(motion.time, sum(parts.values()) + remainder, parts, remainder)


@pytest.fixture(scope="module")
def response():
    """Loops omega_c / s of three joints."""
    omega = np.geomspace(0.01, 1000, 200)
    gain = np.array([5.0, 10.0, 20.0]) / (1j * omega[:, None])
    row = np.ones(3)
    return FrequencyResponse(omega, gain / (1 + gain), gain, *(6 * [row]), row > 0, row)


@pytest.fixture(scope="module")
def sweeps():
    """By place of the encoder and drive."""
    ratio = np.linspace(0.1, 1.5, 15)
    made = {}
    for encoder, start in (("motor", 0.9), ("link", 0.3)):
        made[encoder] = {}
        for drive, slope in (("ideal drive", 0.2), ("the scenario's drive", 0.4)):
            damping = start - slope * ratio[:, None] * np.array([1.0, 1.2, 1.4])
            overshoot = np.where(damping > 0, 30 * (1 - damping), np.nan)
            made[encoder][drive] = StabilitySweep(ratio, damping, overshoot, np.ones(3))
    return made


@pytest.fixture(scope="module")
def figures(motion, runs, steps, compared, budget, response, sweeps):
    """One of each kind."""
    reference = ("reference", plots.REFERENCE, "-", motion.v)
    robot = SimpleNamespace(motor_torque_limit=np.array([5.0, 6.0, 7.0]), joint_names=NAMES)
    rows = np.ones_like(motion.v)
    loads = Loads(load_torque=rows, alleviating_torque=rows * [1.0, -2.0, 0.0])
    speed_lines = [reference, *plots.tracking_lines(runs, "v")]
    error_lines = plots.tracking_lines(runs, "speed_error")
    return {
        "figure2": plots.figure2(motion, NAMES),
        "step_responses": plots.step_responses("steps", steps),
        "speeds": plots.speeds("speeds", motion.time, speed_lines, NAMES),
        "speed_errors": plots.speed_errors("errors", motion.time, error_lines, NAMES, motion),
        "torques": plots.torques("torques", runs["PI"], loads, robot),
        "error_budget": plots.error_budget("budget", budget, NAMES),
        "comparison": plots.comparison("comparison", compared),
        "bode": plots.bode("bode", response, NAMES),
        "stability": plots.stability("stability", sweeps, NAMES),
    }


KINDS = ("figure2", "step_responses", "speeds", "speed_errors", "torques", "error_budget")
PANELS = ("speeds", "speed_errors", "torques", "error_budget")
ANALYSES = ("comparison", "error_budget", "bode", "stability")


def line(ax, label):
    (found,) = [line for line in ax.get_lines() if line.get_label() == label]
    return found


def legend_texts(figure):
    legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes)]
    return [text.get_text() for legend in legends if legend for text in legend.get_texts()]


# --- what is drawn ---------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_every_axis_has_a_label_with_a_unit(figures, kind):
    figure = figures[kind]

    assert isinstance(figure, Figure)
    for ax in figure.axes:
        assert ax.get_ylabel().endswith("]") and "[" in ax.get_ylabel()
    # Panels of one column share their time axis; the lowest one is labelled.
    last_row = figure.axes[-3:] if kind == "figure2" else figure.axes[-1:]
    assert [ax.get_xlabel() for ax in last_row] == ["time [s]"] * len(last_row)


@pytest.mark.parametrize("kind", PANELS)
def test_one_panel_for_each_joint_in_order_with_its_name(figures, kind):
    titles = [ax.get_title(loc="left") for ax in figures[kind].axes]

    assert len(titles) == 3
    for k, (title, name) in enumerate(zip(titles, NAMES, strict=True), start=1):
        assert str(k) in title and name in title


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "figure2"])
def test_legend_names_every_line_once(figures, kind):
    texts = legend_texts(figures[kind])
    labels = {line.get_label() for line in figures[kind].axes[0].get_lines()}

    assert len(texts) == len(set(texts))
    assert {label for label in labels if not label.startswith("_")} <= set(texts)
    assert not [text for text in texts if text.startswith("_")]


def test_one_joint_has_one_panel(motion):
    lines = [("PI", plots.PI, "-", motion.v[:, :1])]
    one = Motion.from_speeds(PERIOD, motion.q[0, :1], motion.v[:, :1])

    assert len(plots.speeds("one", motion.time, lines, NAMES[:1]).axes) == 1
    assert len(plots.speed_errors("one", motion.time, lines, NAMES[:1], one).axes) == 1
    assert len(plots.figure2(one, NAMES[:1]).axes) == 3


def test_colours_of_the_paper(figures):
    for ax in figures["speeds"].axes:
        assert same_color(line(ax, "reference").get_color(), BLUE)
        assert same_color(line(ax, "PI").get_color(), RED)
        assert same_color(line(ax, "PI + CTC").get_color(), GREEN)
        other = line(ax, "PI + CTC, printed sign").get_color()
        assert not any(same_color(other, colour) for colour in (BLUE, RED, GREEN))
    for ax in figures["speed_errors"].axes:
        assert same_color(line(ax, "PI").get_color(), RED)
        assert same_color(line(ax, "PI + CTC").get_color(), GREEN)
    for ax in figures["figure2"].axes:
        assert same_color(ax.get_lines()[0].get_color(), BLUE)


# Machado, Oliveira, Fernandes, "A physiologically-based model for simulation of color vision
# deficiency", 2009: linear RGB as seen without red, green, blue cones.
NO_CONES = {
    "none": np.eye(3),
    "red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998]],
    "green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
              [-0.011820, 0.042940, 0.968881]],
    "blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
             [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


def lab(colour, seen_by):
    """CIE L*a*b* of an sRGB colour (D65), as the eye `seen_by` sees it."""
    rgb = np.array(matplotlib.colors.to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    linear = np.clip(np.array(seen_by) @ linear, 0, 1)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    t = np.array(to_xyz) @ linear / [0.9505, 1.0, 1.089]
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("eye", NO_CONES)
def test_colours_of_lines_in_one_panel_differ_for_every_eye(eye):
    """A difference of 2.3 is just noticeable side by side; lines need many times that."""
    for first, second in combinations(plots.PALETTE[:5], 2):
        seen = [lab(colour, NO_CONES[eye]) for colour in (first, second)]
        assert np.linalg.norm(seen[0] - seen[1]) > 15, (first, second)


def test_effective_inertia_shows_its_range_and_what_is_published(motion):
    t = motion.time[:, None]
    i_eff = np.hstack([4 + np.sin(t), 100 - 10 * t, np.full_like(t, 7.0)])
    figure = plots.effective_inertia("inertia", motion.time, i_eff, NAMES, [5.5, 101, 8])

    for k, ax in enumerate(figure.axes):
        np.testing.assert_array_equal(line(ax, "effective inertia").get_ydata(), i_eff[:, k])
        for label, value in (
            ("largest", i_eff[:, k].max()),
            ("median", np.median(i_eff[:, k])),
            ("smallest", i_eff[:, k].min()),
            ("Table 1 (the paper's motion), largest", [5.5, 101, 8][k]),
        ):
            assert line(ax, label).get_ydata()[0] == value
        low, high = ax.get_ylim()
        assert low < i_eff[:, k].min() and [5.5, 101, 8][k] < high
        assert "kg m²" in ax.get_ylabel()
    assert "variation 30.00 %" in figure.axes[1].get_title(loc="right")  # (100 - 70) / 100
    # One scale, relative to the largest: a joint that varies little looks like it.
    assert len({round(ax.get_ylim()[0] / v, 6) for ax, v in zip(
        figure.axes, i_eff.max(axis=0), strict=True)}) == 1  # fmt: skip
    assert "Table 1 (the paper's motion), largest" in legend_texts(figure)
    plain = plots.effective_inertia("inertia", motion.time, i_eff, NAMES)
    assert "Table 1 (the paper's motion), largest" not in legend_texts(plain)


def test_figure2_shows_position_speed_and_acceleration(figures, motion):
    axes = np.reshape(figures["figure2"].axes, (3, 3))
    columns = (np.degrees(motion.q), motion.v, motion.vd)
    labels = ("position [deg]", "speed [rad/s]", "acceleration [rad/s²]")
    for k in range(3):
        assert NAMES[k] in axes[k, 0].get_title(loc="left")
        for ax, values, label in zip(axes[k], columns, labels, strict=True):
            np.testing.assert_array_equal(ax.get_lines()[0].get_xdata(), motion.time)
            np.testing.assert_array_equal(ax.get_lines()[0].get_ydata(), values[:, k])
            assert ax.get_ylabel() == label


def test_speeds_and_errors_show_the_recordings(figures, motion, runs):
    for k in range(3):
        ax = figures["speeds"].axes[k]
        np.testing.assert_array_equal(line(ax, "reference").get_ydata(), motion.v[:, k])
        np.testing.assert_array_equal(line(ax, "PI").get_ydata(), runs["PI"].v[:, k])
        np.testing.assert_array_equal(line(ax, "PI").get_xdata(), motion.time)
        ax = figures["speed_errors"].axes[k]
        error = runs["PI + CTC"].speed_error
        np.testing.assert_array_equal(line(ax, "PI + CTC").get_ydata(), error[:, k])


def test_errors_name_the_largest_of_each_run(figures):
    title = figures["speed_errors"].axes[1].get_title(loc="right")

    assert "PI 0.123" in title and "PI + CTC 0.022" in title and "rad/s" in title


def test_constant_speed_is_shaded_where_it_counts(figures):
    def shaded(ax):
        (collection,) = [c for c in ax.collections if c.get_label() == "constant speed"]
        return [path.get_extents() for path in collection.get_paths() if len(path.vertices)]

    first, second, third = map(shaded, figures["speed_errors"].axes)
    (box,) = first
    assert (box.x0, box.x1) == pytest.approx((1.0, 3.0))  # from 1 s after the start
    assert second == [] and third == []  # at rest, accelerating
    assert "constant speed" in legend_texts(figures["speed_errors"])


def test_shading_does_not_change_the_scale(motion, runs):
    lines = plots.tracking_lines({"PI": runs["PI"]}, "speed_error")
    plain = plots.speeds("plain", motion.time, lines, NAMES)
    shaded = plots.speed_errors("shaded", motion.time, lines, NAMES, motion)

    assert shaded.axes[0].get_ylim() == plain.axes[0].get_ylim()


def test_limits_of_the_torques_are_widened_by_the_help(figures):
    # Motors of 5, 6, 7 N m; help of +1, -2, 0 N m.
    for ax, lower, upper in zip(
        figures["torques"].axes, (-5, -8, -7), (6, 6, 7), strict=True
    ):  # fmt: skip
        drawn = {line.get_ydata()[0] for line in ax.get_lines() if np.ptp(line.get_ydata()) == 0}
        assert drawn == {lower, upper}


def test_torques_show_motor_and_load(figures, runs):
    ax = figures["torques"].axes[2]

    np.testing.assert_array_equal(line(ax, "motor torque").get_ydata(), runs["PI"].tau[:, 2])
    np.testing.assert_array_equal(line(ax, "load torque").get_ydata(), runs["PI"].load_torque[:, 2])
    assert same_color(line(ax, "motor torque").get_color(), RED)
    assert ax.get_ylabel() == "torque [N m]"


def test_step_responses_name_structure_damping_and_metrics(figures, steps):
    (ax,) = figures["step_responses"].axes
    by_colour = {line.get_color(): line for line in ax.get_lines()}

    np.testing.assert_array_equal(by_colour[RED].get_ydata(), steps["pi"].speed)
    np.testing.assert_array_equal(by_colour[BLUE].get_ydata(), steps["p_in_feedback"].speed)
    for name, look in (("pi", RED), ("p_in_feedback", BLUE)):
        metrics, label = steps[name].metrics, by_colour[look].get_label()
        assert f"{steps[name].zeta:g}" in label
        assert f"{metrics.rise_time:.4f}" in label and f"{metrics.settling_time:.4f}" in label
        assert f"{metrics.overshoot_percent:.2f} %" in label


def test_step_responses_show_a_slow_response_to_its_end():
    t = np.linspace(0, 2, 1001)
    y = 1 - np.exp(-3 * t)
    step = StepResponse("pi", 1.0, t, y, step_metrics(t, y, y0=0.0, y_final=1.0))
    (ax,) = plots.step_responses("slow", {"pi": step}).axes

    settled = step.metrics.settling_time
    assert ax.get_xlim()[1] >= settled, f"settles at {settled:.2f} s, off the figure"


# --- comparison, budget, bode, stability -----------------------------------------------------


def grid(figure):
    """Axes in rows and columns."""
    rows, columns = figure.axes[0].get_gridspec().get_geometry()
    return np.reshape(figure.axes, (rows, columns))


@pytest.mark.parametrize("kind", ANALYSES)
def test_title_of_the_figure(figures, kind):
    assert kind.split("_")[-1] in figures[kind].get_suptitle()


@pytest.mark.parametrize("kind", ANALYSES)
def test_no_panel_is_empty(figures, kind):
    for ax in figures[kind].axes:
        low, high = ax.get_ylim()
        heights = [bar.get_height() for bar in ax.patches]
        values = [y for line in ax.lines for y in np.atleast_1d(line.get_ydata())]
        assert any(low < y <= high for y in [*heights, *values]), ax.get_title(loc="left")


@pytest.mark.parametrize("kind", ANALYSES)
def test_numbers_at_the_axes_are_plain(figures, tmp_path, kind):
    figure = figures[kind]
    plots.save(figure, tmp_path / "figure.svg")
    texts = [
        label.get_text()
        for ax in figure.axes
        for axis in (ax.xaxis, ax.yaxis)
        for label in [*axis.get_ticklabels(), *axis.get_ticklabels(minor=True)]
    ]
    assert len([text for text in texts if text]) > 10
    assert not [text for text in texts if "$" in text or "math" in text or "^" in text]


def test_powers_of_ten_are_written_out(figures, tmp_path):
    def shown(axis, limits):
        return {
            label.get_text()
            for label in axis.get_ticklabels()
            if limits[0] <= (label.get_position()[axis.axis_name == "y"]) <= limits[1]
        }

    ax = figures["comparison"].axes[0]
    plots.save(figures["comparison"], tmp_path / "figure.png")
    assert {"0.001", "0.01", "0.1"} <= shown(ax.yaxis, ax.get_ylim())
    ax = figures["bode"].axes[-1]
    plots.save(figures["bode"], tmp_path / "figure.png")
    assert {"0.1", "1", "10", "100"} <= shown(ax.xaxis, ax.get_xlim())


def test_comparison_has_a_bar_for_each_controller_and_joint(figures, compared):
    figure = figures["comparison"]
    values = (
        [c.tracking.max_abs_speed_error for c in compared],
        [c.tracking.rms_speed_error for c in compared],
        [c.tracking.constant_speed_error for c in compared],
        [np.degrees(c.tracking.max_abs_position_error) for c in compared],
        [100 * c.motors.rms_share for c in compared],
        [100 * c.motors.peak_share for c in compared],
    )
    for ax, rows in zip(figure.axes[:6], values, strict=True):
        assert [c.get_label() for c in ax.containers] == list(LABELS)
        for bars, expected in zip(ax.containers, rows, strict=True):
            np.testing.assert_allclose([bar.get_height() for bar in bars], expected)
            for k, bar in enumerate(bars):  # around the name of its joint
                assert abs(bar.get_x() + bar.get_width() / 2 - k) < 0.5
        edges = sorted((bar.get_x(), bar.get_x() + bar.get_width()) for bar in ax.patches)
        assert all(a[1] <= b[0] + 1e-9 for a, b in pairwise(edges))


def test_comparison_names_joints_controllers_and_units(figures):
    figure = figures["comparison"]
    assert legend_texts(figure) == list(LABELS)
    for ax in figure.axes:
        assert ax.get_title(loc="left").endswith(("[rad/s]", "[deg]", "[%]", "[% of time]"))
    for ax in figure.axes[4:6]:
        names = [label.get_text() for label in ax.get_xticklabels()]
        assert names == ["1 base", "2 elbow", "3 wrist"]
    colours = [bars[0].get_facecolor() for bars in figure.axes[0].containers]
    assert len(set(colours)) == 3


def test_comparison_of_errors_is_logarithmic_and_that_of_torques_starts_at_zero(figures):
    axes = figures["comparison"].axes
    assert [ax.get_yscale() for ax in axes] == 4 * ["log"] + 3 * ["linear"]
    assert [ax.get_ylim()[0] for ax in axes[4:]] == [0, 0, 0]


def test_comparison_shows_what_could_be_felt(figures):
    *others, ax = figures["comparison"].axes
    assert ax.get_title(loc="left") == "error could be felt [% of time]"
    assert [bar.get_height() for bar in ax.patches] == pytest.approx([100, 10, 0.4])
    assert [text.get_text() for text in ax.texts] == ["100.0", "10.0", "0.4"]
    names = [label.get_text().replace("\n", "") for label in ax.get_xticklabels()]
    assert names == list(LABELS)
    for bar, same in zip(ax.patches, others[0].containers, strict=True):
        assert same_color(bar.get_facecolor(), same[0].get_facecolor())


def test_comparison_without_a_head_has_no_panel_for_it(compared, figures):
    headless = plots.comparison("headless", make_compared(LABELS, SHARES, head=False))
    assert len(headless.axes) == 6 == len(figures["comparison"].axes) - 1
    assert headless.get_figheight() < figures["comparison"].get_figheight()


def test_all_controllers_find_room_in_a_comparison(tmp_path):
    feedforwards = ("", "+ctc", "+id")
    labels = ["pi", "pi_ctc", "pi_id", "inverse_dynamics"]
    labels += [kind + more for kind in ("p_pi", "pi_scheduled") for more in feedforwards]
    figure = plots.comparison("all", make_compared(labels, np.linspace(0.1, 1, len(labels))))
    plots.save(figure, tmp_path / "figure.png")

    (legend,) = figure.legends
    boxes = [label.get_window_extent() for label in figure.axes[-1].get_xticklabels()]
    assert legend.get_window_extent().width < figure.bbox.width
    assert min(box.y0 for box in boxes) > legend.get_window_extent().y1
    assert all(a.x1 < b.x0 for a, b in pairwise(boxes))


def test_comparison_without_any_constant_speed_has_no_empty_panel(compared):
    short = [
        dataclasses.replace(
            c,
            tracking=dataclasses.replace(c.tracking, constant_speed_error=np.full(3, np.nan)),
        )
        for c in compared
    ]
    for ax in plots.comparison("short", short).axes:
        heights = [bar.get_height() for bar in ax.patches]
        assert np.isfinite(heights).any() or ax.texts or not ax.get_visible()


def test_budget_shows_the_whole_and_its_parts(figures, budget):
    figure = figures["error_budget"]
    parts = budget.parts | {"speed error": budget.whole, "remainder": budget.remainder}
    del parts["disturbance"]  # there is none

    assert set(legend_texts(figure)) == set(parts)
    for k, ax in enumerate(figure.axes):
        assert len(ax.lines) == len(parts)
        for name, values in parts.items():
            np.testing.assert_array_equal(line(ax, name).get_ydata(), values[:, k])
            np.testing.assert_array_equal(line(ax, name).get_xdata(), budget.time)
        whole = line(ax, "speed error").get_linewidth()
        assert all(
            line(ax, name).get_linewidth() < whole for name in parts if name != "speed error"
        )
        assert len({line.get_color() for line in ax.lines}) == len(parts)


def test_budget_without_a_remainder_does_not_name_it(budget):
    exact = dataclasses.replace(budget, remainder=np.full_like(budget.whole, 1e-8))
    assert "remainder" not in legend_texts(plots.error_budget("exact", exact, NAMES))


def test_bode_shows_size_and_phase(figures, response):
    axes = grid(figures["bode"])
    assert axes.shape == (2, 2)
    angle = {0: -np.arctan(response.omega[:, None] / [5, 10, 20]), 1: np.full((200, 3), -np.pi / 2)}
    for column, values in enumerate((response.tracking, response.loop_gain)):
        for k, name in enumerate(NAMES):
            size = line(axes[0, column], f"joint {k + 1}, {name}")
            np.testing.assert_allclose(size.get_xdata(), response.omega)
            np.testing.assert_allclose(size.get_ydata(), 20 * np.log10(np.abs(values[:, k])))
            phase = axes[1, column].get_lines()[k]
            np.testing.assert_allclose(phase.get_ydata(), np.degrees(angle[column][:, k]))
            assert phase.get_color() == size.get_color()


def test_bode_has_labels_with_units(figures):
    axes = grid(figures["bode"])
    assert {ax.get_ylabel() for ax in axes[0]} == {"size [dB]"}
    assert {ax.get_ylabel() for ax in axes[1]} == {"phase [deg]"}
    assert {ax.get_xlabel() for ax in axes[1]} == {"frequency [rad/s]"}
    assert {ax.get_xscale() for ax in axes.flat} == {"log"}
    assert [ax.get_title(loc="left") for ax in axes[0]] == [
        "speed over its reference",
        "loop, cut at the motor",
    ]
    assert legend_texts(figures["bode"]) == ["joint 1, base", "joint 2, elbow", "joint 3, wrist"]


def test_stability_shows_damping_and_overshoot(figures, sweeps):
    axes = grid(figures["stability"])
    assert axes.shape == (2, 2)
    for column, (encoder, by_drive) in enumerate(sweeps.items()):
        damping, overshoot = axes[:, column]
        assert encoder in damping.get_title(loc="left")
        for i, (drive, sweep) in enumerate(by_drive.items()):
            for k, name in enumerate(NAMES):
                shown = line(damping, f"joint {k + 1}, {name}, {drive}")
                np.testing.assert_array_equal(shown.get_xdata(), sweep.ratio)
                np.testing.assert_array_equal(shown.get_ydata(), sweep.damping[:, k])
                below = overshoot.get_lines()[3 * i + k]
                np.testing.assert_array_equal(below.get_ydata(), sweep.overshoot_percent[:, k])
                look = (shown.get_color(), shown.get_linestyle())
                assert look == (below.get_color(), below.get_linestyle())


def test_stability_tells_joints_by_colour_and_drives_by_dashes(figures):
    lines = [x for x in figures["stability"].axes[0].get_lines() if x.get_label()[0] != "_"]
    assert len(lines) == 6
    assert len({x.get_color() for x in lines}) == 3 and len({x.get_linestyle() for x in lines}) == 2
    texts = legend_texts(figures["stability"])
    assert {x.get_label() for x in lines} == {f"{j}, {d}" for j in texts[:3] for d in texts[3:]}


def test_stability_has_labels(figures):
    axes = grid(figures["stability"])
    assert {ax.get_ylabel() for ax in axes[0]} == {"smallest damping ratio"}
    assert {ax.get_ylabel() for ax in axes[1]} == {"overshoot of the link [%]"}
    assert {ax.get_xlabel() for ax in axes[1]} == {"ω_n / ω_r"}


def test_every_figure_of_the_study(written):
    for name in ("figure2", "figure4", "figure7", "figure8"):
        assert (written.folder / f"{name}.png").stat().st_size > 10_000


def test_figures_leave_the_settings_of_matplotlib_alone(motion, tmp_path):
    before = dict(matplotlib.rcParams)
    plots.save(plots.figure2(motion, NAMES), tmp_path / "figure.png")

    assert dict(matplotlib.rcParams) == before


# --- files -----------------------------------------------------------------------------------


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    ("suffix", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")]
)
def test_save_writes_what_the_suffix_says(figures, tmp_path, suffix, magic):
    path = tmp_path / "new" / "folder" / f"figure.{suffix}"

    assert plots.save(figures["step_responses"], path) == path
    assert path.read_bytes().startswith(magic)
    assert names_in(path.parent) == [f"figure.{suffix}"]


def test_save_takes_a_text_for_a_path(figures, tmp_path):
    plots.save(figures["step_responses"], str(tmp_path / "figure.png"))

    assert names_in(tmp_path) == ["figure.png"]


@pytest.mark.parametrize("name", ["figure.xyz", "figure", "figure.", "figure.csv", ".png"])
def test_save_refuses_an_unknown_suffix(figures, tmp_path, name):
    with pytest.raises(InputError, match=r"\.png") as caught:
        plots.save(figures["step_responses"], tmp_path / name)

    assert str(tmp_path / name) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert names_in(tmp_path) == []


def test_save_replaces_a_file_whole_or_not_at_all(figures, tmp_path, monkeypatch):
    path = tmp_path / "figure.png"
    path.write_bytes(b"old")

    def savefig(self, target, **options):
        target.write(b"half")
        assert path.read_bytes() == b"old"  # while the new one is being written
        raise RuntimeError("power cut")

    with monkeypatch.context() as patch:
        patch.setattr(Figure, "savefig", savefig)
        with pytest.raises(RuntimeError, match="power cut"):
            plots.save(figures["step_responses"], path)
    assert path.read_bytes() == b"old"
    assert names_in(tmp_path) == ["figure.png"]

    plots.save(figures["step_responses"], path)
    assert path.read_bytes().startswith(b"\x89PNG")


def test_the_same_figure_gives_the_same_svg(motion, runs, tmp_path):
    lines = plots.tracking_lines(runs, "speed_error")
    texts = []
    for name in ("first.svg", "second.svg"):
        figure = plots.speed_errors("errors", motion.time, lines, NAMES, motion)
        texts.append(plots.save(figure, tmp_path / name).read_bytes())

    assert texts[0] == texts[1]
    assert b"<dc:date>" not in texts[0]


def test_names_with_dollar_signs_are_text(motion, tmp_path):
    """Joint and scenario names are the user's: they are no TeX."""
    names = ("$x^{$", "cost in $", "a_b^c")
    figure = plots.figure2(motion, names)
    plots.save(figure, tmp_path / "figure.png")
    lines = [("PI", plots.PI, "-", motion.v)]
    plots.save(plots.speeds("$x^{$", motion.time, lines, names), tmp_path / "speeds.png")


def test_names_with_dollar_signs_are_text_in_analyses(compared, budget, response, sweeps, tmp_path):
    names = ("$x^{$", "cost in $", "a_b^c")
    design = SimpleNamespace(robot=headless_robot(names))
    odd = [dataclasses.replace(c, design=design) for c in compared]
    for figure in (
        plots.comparison("$x^{$", odd),
        plots.error_budget("$x^{$", budget, names),
        plots.bode("$x^{$", response, names),
        plots.stability("$x^{$", sweeps, names),
    ):
        plots.save(figure, tmp_path / "figure.png")
