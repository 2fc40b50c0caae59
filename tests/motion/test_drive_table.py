"""What the drives get, against the equations of the gears."""

from __future__ import annotations

import numpy as np

from sdt_drake.dynamics import torque_groups
from sdt_drake.motion import load_profile, plan_motion, write_drive_table
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
