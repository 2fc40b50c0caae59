"""What the drives get, against the equations of the gears."""

from __future__ import annotations

import numpy as np
import pytest

from sdt_drake.dynamics import torque_groups
from sdt_drake.errors import InputError
from sdt_drake.motion import (
    CommandProfile,
    Knots,
    ends_in_motion,
    load_profile,
    plan_motion,
    write_drive_table,
)
from sdt_drake.tables import read_table


def test_a_drive_table_is_motor_side_with_the_whole_torque(robot, tmp_path):
    plan = plan_motion(robot, load_profile("package://sdt/motions/reference.yaml"))
    path = tmp_path / "drives.csv"
    write_drive_table(path, robot, plan)
    time, columns = read_table(path)
    motion, r = plan.motion, np.array([67.2, 1, 1, 1])
    assert list(columns) == ["q_motor", "v_motor", "tau_motor"]
    np.testing.assert_array_equal(time, motion.time)
    np.testing.assert_allclose(columns["q_motor"], r * motion.q)
    np.testing.assert_allclose(columns["v_motor"], r * motion.v)
    # Eq. 3: a motor turns its own inertia at r times the acceleration, and the links over its gear.
    links = torque_groups(robot, motion.q, motion.v, motion.vd).total
    own = np.array([0.1291, 1.73, 0.531, 0.531]) * r * motion.vd
    np.testing.assert_allclose(columns["tau_motor"], links / r + own, atol=1e-8)
    assert np.abs(columns["tau_motor"][:, 0]).max() < 203.2


@pytest.mark.parametrize(
    "knots, outcome",
    [([[0, 0.1], [1, 0]], "starts at 0.1 rad/s"), ([[0, 0], [1, -0.1]], "ends at -0.1 rad/s")],
)
def test_no_drive_table_of_a_motion_that_is_not_from_rest_to_rest(robot, tmp_path, knots, outcome):
    still = Knots([[0, 0], [1, 0]])
    plan = plan_motion(
        robot, CommandProfile("go", "", 1, None, [still, Knots(knots), still, still])
    )
    assert ends_in_motion(robot, plan.motion) == [f"joint 2 'roll' {outcome}"]
    with pytest.raises(InputError, match=rf"drives\.csv: joint 2 'roll' {outcome}, expected rest"):
        write_drive_table(tmp_path / "drives.csv", robot, plan)
    assert not list(tmp_path.iterdir())
