"""The figure of what the pilot feels shows its numbers."""

import numpy as np
import pytest
from variants import recorded

from sdt_drake.analysis.illusions import feel
from sdt_drake.analysis.perception import CHANNELS, canals
from sdt_drake.analysis.tracking import track_head
from sdt_drake.motion import Motion, Story, TimedSegment
from sdt_drake.robot.head import GRAVITY
from sdt_drake.show.figures import pilot as plots_pilot

PERIOD = 0.005


def head_of(motion, robot, scale):
    """Tracking of a run whose speeds and angles are off by a share of the reference."""
    recording = recorded(motion, q=scale * motion.q, v=scale * motion.v)
    return recording, track_head(recording, robot)


def lines_of(ax):
    return {line.get_label(): line.get_xydata() for line in ax.lines}


def test_panels_show_what_changes_and_the_error(design, robot):
    recording, head = head_of(design.motion, robot, 0.99)
    *panels, attitude, error = plots_pilot.pilot("run", recording.time, head).axes
    names = [ax.get_title(loc="left") for ax in panels]
    assert [name.split(",")[0] for name in names] == [
        *(f"force along {axis}" for axis in "xyz"),
        *(f"rotation about {axis}" for axis in "xyz"),
    ]
    for k in range(3):
        force, rotation = lines_of(panels[k]), lines_of(panels[3 + k])
        for label, motion in (("reference", head.reference), ("achieved", head.achieved)):
            in_g = motion.specific_force[:, k] / GRAVITY
            np.testing.assert_array_equal(force[label], np.column_stack([recording.time, in_g]))
            rate = np.degrees(motion.angular_velocity[:, k])
            np.testing.assert_array_equal(rotation[label][:, 1], rate)
        told = np.degrees(canals(head.achieved.angular_velocity[:, k], PERIOD))
        np.testing.assert_array_equal(rotation["sensed by the canals (achieved)"][:, 1], told)
    shown = lines_of(error)
    np.testing.assert_array_equal(shown["threshold: just felt"][:, 1], 1)
    assert len([name for name in shown if name.startswith("error, ")]) == 2
    for kind in (slice(0, 3), slice(3, 6)):
        k = kind.start + int(head.felt.largest[kind].argmax())
        felt = shown[f"error, {CHANNELS[k]}, largest of its kind"][:, 1]
        np.testing.assert_array_equal(felt, head.felt.multiples[:, k])
    angles, own = lines_of(attitude), feel(head.achieved, PERIOD, "clark2019")
    np.testing.assert_allclose(
        angles["nose up, felt (predicted)"][:, 1], np.degrees(own.pitch), atol=1e-6
    )
    down = -head.achieved.rotation[:, 2]
    np.testing.assert_allclose(np.sin(np.radians(angles["nose up, true"][:, 1])), -down[:, 0])
    assert "no medical statement" in attitude.get_title(loc="right")
    assert f"{100 * head.felt.share:.1f} % of the time" in error.get_title(loc="right")


def test_only_what_changes_is_shown_and_segments_have_names(robot):
    """The yaw joint turns alone, about the vertical: no lean, and no rotation but about z."""
    t = np.arange(2001) * PERIOD
    v = np.outer(1 - np.cos(0.2 * np.pi * t), [0, 0, 0, 0.5])
    recording, head = head_of(Motion.from_speeds(PERIOD, np.zeros(4), v), robot, 1.0)
    segments = (
        TimedSegment("yaw", 0, 2, "to 1 deg/s, cosine"),
        TimedSegment("yaw", 2, 7, "hold"),
        TimedSegment("yaw", 7, 7.5, "to 0 deg/s"),
        TimedSegment("roll", 3, 3.1, "to 1.5 G"),
        TimedSegment("roll", 3.4, 4, "hold"),
    )
    story = Story("Spin", "It stops.", segments)
    *panels, _, error, band = plots_pilot.pilot("run", recording.time, head, story).axes
    names = [ax.get_title(loc="left") for ax in panels]
    assert [name for name in names if "rotation" in name] == ["rotation about z, turn left"]
    assert "force along z, up" not in names
    title = error.figure.get_suptitle().splitlines()
    assert title[:2] == ["Spin", "To be felt: It stops."] and "force along z, up" in title[2]
    assert "%" not in "".join(title)
    assert error.get_title(loc="right") == "never felt: at most 0 times the threshold"
    names = [(text.get_text(), text.get_position()[0]) for text in band.texts]
    # Within the segment, behind one that is too short, and over both where that is not enough.
    assert names[:3] == [(" to 1 deg/s", 0), (" hold", 2), (" to 0 deg/s", 7.5)]
    assert names[3:] == [(" to 1…", 3), (" hold", 3.4)]


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
