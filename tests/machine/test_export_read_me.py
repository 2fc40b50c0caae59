"""The README of an exported folder."""

from __future__ import annotations

import re

import numpy as np

import sdt_drake as sdt
from sdt_drake.machine.drive_files import load_drives
from sdt_drake.motion import Motion


def test_units_and_homing_are_those_of_the_files(designed, tmp_path):
    hump = np.sin(np.linspace(0, np.pi, 41)) ** 2
    v = np.outer(hump, [0.05, 0.2, 0, -0.4])
    motion = Motion.from_speeds(0.005, np.array([0.1, -0.2, 0.3, 0]), v)
    design, drives = designed("training", motion=motion), load_drives("drives", 4)
    drives.axes[1].sign, drives.axes[3].zero = -1, 4096
    sdt.export(design, drives, tmp_path, title="short")
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    axes, homing = ([row for row in rows if row[0] in "1234" and len(row) == n] for n in (8, 6))

    points = np.genfromtxt(tmp_path / "set_points.csv", delimiter=",", names=True, deletechars="")
    for k, axis in enumerate(drives.axes):
        assert axes[k][1] == homing[k][1] == design.robot.joint_names[k]
        assert [int(axes[k][i]) for i in (2, 4)] == [axis.increments, axis.sign]
        assert axis.speed_unit in axes[k] and f"{axis.rated_torque:g} N m" in axes[k][6]
        positions = points[f"607Ah_{k + 1}"]
        zero, first, start, last = (float(homing[k][i]) for i in (2, 3, 4, 5))
        assert (zero, first, last) == (axis.zero, positions[0], positions[-1])
        np.testing.assert_allclose(start, np.degrees(design.motion.q[0, k]), atol=1e-4)
    for name in re.findall(r"^\| (\S+\.\w+) \|", text, re.MULTILINE):
        assert (tmp_path / name).stat().st_size
    assert sdt.__version__ in text
