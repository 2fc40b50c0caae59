"""Figures: panels, labels, colours, and files."""

from types import SimpleNamespace

import numpy as np
import pytest
from figures import legend_texts, line, shown_ticks
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from variants import recorded

from sdt_drake.analysis.budget import ErrorBudget
from sdt_drake.analysis.frequency_response import FrequencyResponse
from sdt_drake.analysis.reproduction import StepResponse
from sdt_drake.analysis.stability import StabilitySweep
from sdt_drake.analysis.step import step_metrics
from sdt_drake.motion import Motion
from sdt_drake.robot.dynamics import Loads
from sdt_drake.show.figures import runs as plots

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
    torque = np.cumsum(np.ones_like(motion.v), axis=0) / 100
    torques = {"tau_cmd": torque, "tau": torque / 2, "load_torque": -torque}
    return recorded(motion, v=motion.v + error, **torques)


@pytest.fixture(scope="module")
def runs(motion):
    return {
        "pi": make_recording(motion, -0.123),
        "pi_ctc": make_recording(motion, np.array([0.011, -0.022, 0.033])),
        "pi_ctc, printed sign": make_recording(motion, 0.4),
    }


@pytest.fixture(scope="module")
def steps():
    t = np.linspace(0, 0.5, 1001)
    speeds = {"pi": 1 - np.exp(-30 * t) * np.cos(40 * t), "p_in_feedback": 1 - np.exp(-20 * t)}
    return {
        name: StepResponse(name, zeta, t, y, step_metrics(t, y, y0=0.0, y_final=1.0))
        for (name, y), zeta in zip(speeds.items(), (1.0, 0.95), strict=True)
    }


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
    row, crossover = np.ones(3), np.array([5.0, 10.0, 20.0])
    margins = (90 * row, np.array([np.inf, 2.0, np.inf]), 0 * row, row)
    found = (crossover, row, row, crossover, *margins, row, row > 0, row)
    return FrequencyResponse(omega, gain / (1 + gain), gain, *found)


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
def figures(motion, runs, steps, budget, response, sweeps):
    """One of each kind."""
    robot = SimpleNamespace(motor_torque_limit=np.array([5.0, 6.0, 7.0]), joint_names=NAMES)
    rows = np.ones_like(motion.v)
    loads = Loads(load_torque=rows, alleviating_torque=rows * [1.0, -2.0, 0.0])
    return {
        "trajectories": plots.trajectories("motion", motion, NAMES),
        "step_responses": plots.step_responses("steps", steps),
        "speeds": plots.speeds("speeds", runs, NAMES),
        "speed_errors": plots.speed_errors("errors", runs, NAMES, motion),
        "torques": plots.torques("torques", runs["pi"], loads, robot),
        "error_budget": plots.error_budget("budget", budget, NAMES),
        "bode": plots.bode("bode", response, NAMES),
        "stability": plots.stability("stability", sweeps, NAMES),
    }


KINDS = ("trajectories", "step_responses", "speeds", "speed_errors", "torques", "error_budget")
PANELS = ("speeds", "speed_errors", "torques", "error_budget")


# --- what is drawn ---------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_every_axis_has_a_label_with_a_unit(figures, kind):
    figure = figures[kind]

    assert isinstance(figure, Figure)
    for ax in figure.axes:
        assert ax.get_ylabel().endswith("]") and "[" in ax.get_ylabel()
    # Panels of one column share their time axis; the lowest one is labelled.
    last_row = figure.axes[-3:] if kind == "trajectories" else figure.axes[-1:]
    assert [ax.get_xlabel() for ax in last_row] == ["time [s]"] * len(last_row)


@pytest.mark.parametrize("kind", PANELS)
def test_one_panel_for_each_joint_in_order_with_its_name(figures, kind):
    titles = [ax.get_title(loc="left") for ax in figures[kind].axes]

    assert len(titles) == 3
    for k, (title, name) in enumerate(zip(titles, NAMES, strict=True), start=1):
        assert str(k) in title and name in title


def test_colours_of_the_paper(figures):
    for ax in figures["speeds"].axes:
        assert same_color(line(ax, "reference").get_color(), BLUE)
        assert same_color(line(ax, "pi").get_color(), RED)
        assert same_color(line(ax, "pi_ctc").get_color(), GREEN)
        other = line(ax, "pi_ctc, printed sign").get_color()
        assert not any(same_color(other, colour) for colour in (BLUE, RED, GREEN))
    for ax in figures["speed_errors"].axes:
        assert same_color(line(ax, "pi").get_color(), RED)
        assert same_color(line(ax, "pi_ctc").get_color(), GREEN)
    for ax in figures["trajectories"].axes:
        assert same_color(ax.get_lines()[0].get_color(), BLUE)


def test_the_legend_of_stability_tells_the_rule_from_the_loops(figures):
    (rule,) = (h for h in figures["stability"].legends[0].legend_handles if "0.5" in h.get_label())
    drawn = [x for x in figures["stability"].axes[0].lines if x.get_label() == rule.get_label()]
    assert [x.get_xdata()[0] for x in drawn] == [0.5]
    assert drawn[0].get_linestyle() == rule.get_linestyle() == ":"


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
        shown = max(i_eff[:, k].max(), [5.5, 101, 8][k]) - i_eff[:, k].min()
        assert high - low < 1.3 * shown  # it fills the panel
        assert "kg m²" in ax.get_ylabel()
    assert "variation 30.00 %" in figure.axes[1].get_title(loc="right")  # (100 - 70) / 100
    assert "Table 1 (the paper's motion), largest" in legend_texts(figure)
    plain = plots.effective_inertia("inertia", motion.time, i_eff, NAMES)
    low, high = plain.axes[2].get_ylim()
    assert (low, high) == pytest.approx((0.995 * 7, 1.005 * 7))  # constant, and looks like it
    assert "Table 1 (the paper's motion), largest" not in legend_texts(plain)


def test_trajectories_show_position_speed_and_acceleration(figures, motion):
    axes = np.reshape(figures["trajectories"].axes, (3, 3))
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
        np.testing.assert_array_equal(line(ax, "pi").get_ydata(), runs["pi"].v[:, k])
        np.testing.assert_array_equal(line(ax, "pi").get_xdata(), motion.time)
        ax = figures["speed_errors"].axes[k]
        error = runs["pi_ctc"].speed_error
        np.testing.assert_array_equal(line(ax, "pi_ctc").get_ydata(), error[:, k])


def test_errors_name_the_largest_of_each_run(figures):
    title = figures["speed_errors"].axes[1].get_title(loc="right")

    assert "pi 0.123" in title and "pi_ctc 0.022" in title and "rad/s" in title


def test_constant_speed_is_shaded_where_it_counts(figures):
    def shaded(ax):
        grey = [c for c in ax.collections if c.get_label() == "constant speed"]
        return [path.get_extents() for c in grey for path in c.get_paths()]

    first, second, third = map(shaded, figures["speed_errors"].axes)
    (box,) = first
    assert (box.x0, box.x1) == pytest.approx((1.0, 3.0))  # from 1 s after the start
    assert second == [] and third == []  # at rest, accelerating
    assert "constant speed" in legend_texts(figures["speed_errors"])


def test_limits_of_the_torques_are_widened_by_the_help(figures):
    # Motors of 5, 6, 7 N m; help of +1, -2, 0 N m.
    for ax, lower, upper in zip(
        figures["torques"].axes, (-5, -8, -7), (6, 6, 7), strict=True
    ):  # fmt: skip
        drawn = {line.get_ydata()[0] for line in ax.get_lines() if np.ptp(line.get_ydata()) == 0}
        assert drawn == {lower, upper}


def test_torques_show_motor_and_load(figures, runs):
    ax = figures["torques"].axes[2]

    np.testing.assert_array_equal(line(ax, "motor torque").get_ydata(), runs["pi"].tau[:, 2])
    np.testing.assert_array_equal(line(ax, "load torque").get_ydata(), runs["pi"].load_torque[:, 2])
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


# --- budget, bode, stability -------------------------------------------------------------------


def grid(figure):
    """Axes in rows and columns."""
    rows, columns = figure.axes[0].get_gridspec().get_geometry()
    return np.reshape(figure.axes, (rows, columns))


def test_powers_of_ten_are_written_out(figures):
    assert {"0.1", "1", "10", "100"} <= shown_ticks(figures["bode"].axes[-1].xaxis)


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


def test_bode_shows_magnitude_and_phase(figures, response):
    axes = grid(figures["bode"])
    assert axes.shape == (2, 2)
    angle = {0: -np.arctan(response.omega[:, None] / [5, 10, 20]), 1: np.full((200, 3), -np.pi / 2)}
    for column, values in enumerate((response.tracking, response.loop_gain)):
        for k, name in enumerate(NAMES):
            size = line(axes[0, column], f"joint {k + 1}, {name}")
            np.testing.assert_allclose(size.get_xdata(), response.omega)
            np.testing.assert_allclose(size.get_ydata(), 20 * np.log10(np.abs(values[:, k])))
            phase = line(axes[1, column], f"joint {k + 1}, {name}")
            np.testing.assert_allclose(phase.get_ydata(), np.degrees(angle[column][:, k]))
            assert phase.get_color() == size.get_color()


def test_bode_has_labels_with_units(figures):
    axes = grid(figures["bode"])
    assert {ax.get_ylabel() for ax in axes[0]} == {"magnitude [dB]"}
    assert {ax.get_ylabel() for ax in axes[1]} == {"phase [deg]"}
    assert {ax.get_xlabel() for ax in axes[1]} == {"frequency [rad/s]"}
    assert {ax.get_xscale() for ax in axes.flat} == {"log"}
    assert [ax.get_title(loc="left") for ax in axes[0]] == [
        "speed over its reference",
        "loop, cut at the motor",
    ]
    assert legend_texts(figures["bode"]) == ["joint 1, base", "joint 2, elbow", "joint 3, wrist"]


def test_bode_marks_bandwidth_and_margins(figures):
    """Of loops omega_c / s: fallen by 3 dB, and across 0 dB, at omega_c; 90 deg from -180."""
    axes = grid(figures["bode"])
    for ax, expected in ((axes[0, 0], -3), (axes[0, 1], 0), (axes[1, 1], -90)):
        dots = [line for line in ax.lines if len(line.get_xdata()) == 1]
        np.testing.assert_allclose([dot.get_xdata()[0] for dot in dots], [5, 10, 20])
        np.testing.assert_allclose([dot.get_ydata()[0] for dot in dots], expected)
    ends = [bar.get_segments()[0][:, 1] for bar in axes[1, 1].collections]
    np.testing.assert_allclose(ends, [[-180, -90]] * 3)
    (gain_margin,) = axes[0, 1].collections
    assert gain_margin.get_segments()[0][:, 1] == pytest.approx([-6.02, 0], abs=0.01)
    assert axes[0, 0].get_title(loc="right") == "bandwidth 5, 10, 20 rad/s"
    assert axes[0, 1].get_title(loc="right") == "gain margin –, 6, – dB"
    assert axes[1, 1].get_title(loc="right") == "phase margin 90, 90, 90 deg"
    assert plots._of_joints("gain margin [dB]", np.full(6, np.nan)) == "gain margin – dB"
    many = np.array([3, 1, np.nan, 9, 4, 5])  # joints: no room for a number of each
    assert plots._of_joints("bandwidth [rad/s]", many) == "bandwidth 1 to 9 rad/s"


def test_stability_says_so_where_no_loop_is_stable():
    one = StabilitySweep(np.ones(2), np.full((2, 3), -1.0), np.full((2, 3), np.nan), np.ones(3))
    figure = plots.stability("stability", {"link": {"ideal drive": one}}, NAMES)
    assert [text.get_text() for text in figure.axes[1].texts] == ["unstable"]


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
