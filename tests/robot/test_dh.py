"""The tables of Denavit and Hartenberg become the robots that they are of."""

import dh
import numpy as np
import pytest

from sdt_drake.robot.robot import load_robot


@pytest.mark.parametrize("table", [dh.UR10, dh.KUKA_KR300], ids=lambda table: table.name)
def test_links_stand_where_the_product_of_the_table_puts_them(table, tmp_path):
    robot = load_robot(table.write(tmp_path))
    q = np.random.default_rng(1).uniform(-2, 2, robot.n)
    context = robot.plant.CreateDefaultContext()
    robot.plant.SetPositions(context, q)
    c, s = np.cos(table.base[0]), np.sin(table.base[0])
    pose = np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])
    for k in range(robot.n):
        c, s = np.cos(q[k] + table.theta[k]), np.sin(q[k] + table.theta[k])
        ca, sa = np.cos(table.alpha[k]), np.sin(table.alpha[k])
        pose = pose @ [  # as textbooks print it
            [c, -s * ca, s * sa, table.a[k] * c],
            [s, c * ca, -c * sa, table.a[k] * s],
            [0, sa, ca, table.d[k]],
            [0, 0, 0, 1],
        ]
        link = robot.plant.GetBodyByName(f"link_{k + 1}")
        found = robot.plant.EvalBodyPoseInWorld(context, link).GetAsMatrix4()
        assert found == pytest.approx(pose, abs=1e-12)
