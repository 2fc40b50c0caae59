"""Readers of the files that an export writes, as a drive or a controller would read them."""

import json
import re

import numpy as np

from sdt_drake.machine.drive_files.drives import OBJECTS
from sdt_drake.machine.drive_files.formats import samples_from_cam
from sdt_drake.machine.drive_files.set_points import Samples, SetPoints


def read_csv(path, drives) -> SetPoints:
    """Set points; 0 for what no drive reads."""
    names, table = _read_integers(path)
    assert table[:, 0].tolist() == list(range(len(table)))
    return _points(drives, dict(zip(names[1:], table[:, 1:].T, strict=True)))


def read_st(path, drives) -> SetPoints:
    """The arrays of a function block."""
    pattern = r"(\w+)_(\d+) : ARRAY\[0\.\.(\d+)\] OF D?INT := \[([-\d,\s]*)\];"
    objects, columns = {name: index for index, (name, *_) in OBJECTS.items()}, {}
    for name, k, last, values in re.findall(pattern, path.read_text(encoding="utf-8")):
        columns[f"{objects[name]}_{k}"] = np.array(values.split(","), dtype=np.int64)
        assert len(columns[f"{objects[name]}_{k}"]) == int(last) + 1
    return _points(drives, columns)


def read_cam(path, robot, drives) -> Samples:
    """What cubics between the points command."""
    names, table = _read_integers(path)
    axes = range(1, robot.n + 1)
    assert names == ["cycle", *(f"{what}_{k}" for what in ("position", "speed") for k in axes)]
    return samples_from_cam(robot, drives, table)


def read_trajectory(path, robot) -> Samples:
    first, _, *lines = path.read_text(encoding="utf-8").splitlines()
    assert first == f"joint_names: {json.dumps(list(robot.joint_names))}"
    points = [json.loads(line[2:]) for line in lines]
    since = [point["time_from_start"] for point in points]
    time = np.array([x["sec"] + 1e-9 * x["nanosec"] for x in since])
    assert np.ptp(np.diff(time)) < 2e-9
    q, v = (np.array([x[name] for x in points]) for name in ("positions", "velocities"))
    tau = np.array([x.get("effort", np.zeros(robot.n)) for x in points])
    return Samples(time[-1] / (len(time) - 1), q, v, tau)


def _read_integers(path):
    header, *lines = path.read_text(encoding="ascii").splitlines()
    return header.split(","), np.loadtxt(lines, dtype=np.int64, delimiter=",", ndmin=2)


def _points(drives, columns) -> SetPoints:
    rows = len(next(iter(columns.values())))
    points = SetPoints(*(np.zeros((rows, len(drives.axes)), dtype=np.int64) for _ in range(3)))
    wanted = {f"{x}_{k + 1}" for k, axis in enumerate(drives.axes) for x in axis.objects}
    assert set(columns) == wanted
    for name, column in columns.items():
        index, k = name.split("_")
        points.of_object(index)[:, int(k) - 1] = column
    return points
