"""Figures: panels, labels, colours, and files."""

from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure

from sdt_drake.analysis import plots
from sdt_drake.analysis.study import StepResponse
from sdt_drake.control import step_metrics
from sdt_drake.dynamics import Loads
from sdt_drake.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.simulate import Recording

PERIOD = 0.01
NAMES = ("base", "elbow", "wrist")
BLUE, RED, GREEN = "tab:blue", "tab:red", "tab:green"  # reference, PI, PI + CTC of the paper


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


@pytest.fixture(scope="module")
def figures(motion, runs, steps):
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
    }


KINDS = ("figure2", "step_responses", "speeds", "speed_errors", "torques")
PANELS = ("speeds", "speed_errors", "torques")


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
        target.write_bytes(b"half")
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
