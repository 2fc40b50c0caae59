"""The figure of what the pilot feels shows its numbers."""

from itertools import pairwise

import numpy as np
import pytest

from sdt_drake.analysis import plots_pilot, style
from sdt_drake.analysis.tracking import track_head
from sdt_drake.motion import Motion
from sdt_drake.pilot import GRAVITY, canals
from sdt_drake.simulate import Recording

PERIOD = 0.005


def head_of(motion, robot, scale):
    """Tracking of a run whose speeds and angles are off by a share of the reference."""
    zero = np.zeros_like(motion.v)
    torques = dict.fromkeys(
        ("tau_cmd", "tau_limited", "tau", "load_torque", "tau_peak", "tau_rms"), zero
    )
    recording = Recording(
        time=motion.time,
        q_ref=motion.q,
        v_ref=motion.v,
        q=scale * motion.q,
        v=scale * motion.v,
        saturated=zero,
        beyond_stop=zero,
        **torques,
    )
    return recording, track_head(recording, robot)


def lines_of(ax):
    return {line.get_label(): line.get_xydata() for line in ax.lines}


def test_nine_panels_show_force_rotation_and_error(design, robot):
    recording, head = head_of(design.motion, robot, 0.99)
    figure = plots_pilot.pilot("run", recording.time, head)
    axes = np.array(figure.axes).reshape(3, 3)

    for k in range(3):
        force, rotation, error = (lines_of(ax) for ax in axes[:, k])
        for label, motion in (("reference", head.reference), ("achieved", head.achieved)):
            in_g = motion.specific_force[:, k] / GRAVITY
            np.testing.assert_array_equal(force[label], np.column_stack([recording.time, in_g]))
            rate = np.degrees(motion.angular_velocity[:, k])
            np.testing.assert_array_equal(rotation[label][:, 1], rate)
        told = np.degrees(canals(head.achieved.angular_velocity[:, k], PERIOD))
        np.testing.assert_array_equal(rotation["what the canals tell (achieved)"][:, 1], told)
        np.testing.assert_array_equal(error["error of rotation"][:, 1], head.felt.multiples[:, k])
        np.testing.assert_array_equal(error["error of force"][:, 1], head.felt.multiples[:, 3 + k])
        np.testing.assert_array_equal(error["just felt"][:, 1], 1)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(texts) == len(set(texts)) == 7
    assert f"{100 * head.felt.share:.1f} % of the time" in figure.get_suptitle()


@pytest.mark.parametrize("scale", [1.0, 0.99, 0.0])
def test_the_threshold_and_the_largest_error_are_in_sight(design, robot, scale):
    rows = slice(0, 2001)
    motion = Motion(PERIOD, *(getattr(design.motion, name)[rows] for name in ("q", "v", "vd")))
    recording, head = head_of(motion, robot, scale)
    figure = plots_pilot.pilot("run", recording.time, head)

    low, high = figure.axes[-1].get_ylim()
    assert 0 < low < 1 < high and head.felt.multiples.max() < high
    assert low <= max(head.felt.multiples.max(), 0.1)
    assert figure.axes[0].get_xlim() == (0, recording.time[-1])


@pytest.mark.parametrize("count", [2, 2001])
def test_numbers_of_neighbouring_time_axes_stay_apart(design, robot, tmp_path, count):
    parts = (getattr(design.motion, name)[:count] for name in ("q", "v", "vd"))
    recording, head = head_of(Motion(PERIOD, *parts), robot, 0.99)
    figure = plots_pilot.pilot("run", recording.time, head)
    style.save(figure, tmp_path / "figure.png")

    boxes = []
    for ax in figure.axes[-3:]:
        low, high = ax.get_xlim()
        labels = [t for t in ax.get_xticklabels() if low <= t.get_position()[0] <= high]
        boxes += [label.get_window_extent() for label in labels]
    assert len(boxes) > 6 and all(a.x1 < b.x0 for a, b in pairwise(boxes))
