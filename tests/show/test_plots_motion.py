"""The figure of a planned motion."""

from __future__ import annotations

import numpy as np

from sdt_drake.motion import load_command, margins, retime
from sdt_drake.robot.device import Drive
from sdt_drake.robot.motors import as_driven
from sdt_drake.show import style
from sdt_drake.show.figures import motions as plots_motion


def test_the_figure_of_a_plan_shows_torques_speeds_limits_and_where_it_is_tightest(robot, tmp_path):
    plan = retime(robot, load_command("reference", robot), torque_margin=0.8)
    robot = as_driven(robot, Drive(n1=[80, 0.8, 1, 1], n0=[250, 3, 3, 3]))
    report = margins(robot, plan.motion)
    figure = plots_motion.plan("a plan", robot, plan, report)
    assert len(figure.axes) == 2 * robot.n
    for k, (torque, speed) in enumerate(zip(figure.axes[::2], figure.axes[1::2], strict=True)):
        lines = {line.get_label(): line.get_ydata() for line in torque.lines}
        np.testing.assert_array_equal(lines["planned"], report.torque[:, k])
        np.testing.assert_allclose(lines["limit"], robot.effort_limit[k])
        np.testing.assert_allclose(lines["limit with margin"], 0.8 * robot.effort_limit[k])
        lines = {line.get_label(): line.get_ydata() for line in speed.lines}
        np.testing.assert_array_equal(lines["planned"], plan.motion.v[:, k])
        np.testing.assert_array_equal(lines["commanded"], plan.commanded.v[:, k])
        place = report.tightest(k)
        assert f"{100 * place.share:.1f} %" in speed.get_title("right")
        assert robot.joint_names[k] in torque.get_title("left")
        assert "[N m]" in torque.get_ylabel() and "[rad/s]" in speed.get_ylabel()
    (legend,) = figure.legends
    names = [text.get_text() for text in legend.get_texts()]
    assert len(names) == len(set(names)) and {"held back", "tightest"} <= set(names)
    assert style.save(figure, tmp_path / "plan.png").stat().st_size > 20_000
