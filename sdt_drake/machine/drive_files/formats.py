"""Write and read the file formats of drives and controllers."""

import heapq
import json
import re
from collections.abc import Sequence
from pathlib import Path
from string import Template

import numpy as np
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake.io.arrays import Array
from sdt_drake.io.files import replacing, write_text
from sdt_drake.io.tables import write_table
from sdt_drake.machine.drive_files.drives import OBJECTS, TORQUE, Drives
from sdt_drake.machine.drive_files.set_points import Integers, Samples, SetPoints
from sdt_drake.robot.robot import Robot

_VALUES_PER_LINE = 16  # values of an array in a line of Structured Text


def _columns(drives: Drives) -> list[tuple[str, int]]:
    """Return object and axis (from 0) of each column: all positions first, as in PDO mappings."""
    return [
        (index, k)
        for index in OBJECTS
        for k, axis in enumerate(drives.axes)
        if index in axis.objects
    ]


# --- SI units --------------------------------------------------------------------------------


def write_drive_table(path: Path, robot: Robot, samples: Samples) -> None:
    """Write time [s], q_motor_k [rad], v_motor_k [rad/s], tau_motor_k [N m], all **motor side**.

    q_motor = C q, v_motor = C v, tau = C' tau_motor. C is the robot's coupling: a diagonal matrix
    of gear ratios unless a motor also turns with another joint. tau is the full inverse dynamics
    with the inertia of the motors. So tau_motor is a motor's whole torque, for the additive torque
    set point of its drive. Switch off any acceleration feedforward in the drive. A row holds until
    the next one; the last row has no acceleration.
    """
    time = np.arange(float(len(samples.q))) * samples.period
    q, v = robot.of_motors(samples.q), robot.of_motors(samples.v)
    tau = robot.motor_torque(samples.tau)
    write_table(path, time, {"q_motor": q, "v_motor": v, "tau_motor": tau})


# --- integers, a row for each cycle ----------------------------------------------------------


def write_csv(path: Path, drives: Drives, points: SetPoints) -> None:
    """Write integers as CSV: the cycle from 0, and columns such as `607Ah_k` for each object."""
    columns = _columns(drives)
    table = [points.of_object(index)[:, k] for index, k in columns]
    table.insert(0, np.arange(len(points.position)))
    header = ["cycle", *(f"{index}_{k + 1}" for index, k in columns)]
    _write_integers(path, header, np.stack(table, axis=1))


# --- Structured Text -------------------------------------------------------------------------


def write_st(path: Path, drives: Drives, points: SetPoints, rest: SetPoints, title: str) -> None:
    """Write a function block of IEC 61131-3 that outputs one row of its arrays in each call.

    The PLC calls it once per cycle. While Execute is FALSE the outputs are the first row of `rest`.
    The motion's own first row already has the speed and the torque of the first cycle.
    """
    columns, last = _columns(drives), len(points.position) - 1
    outputs = {OBJECTS[index][0]: (index, _type_of(index)) for index, _ in columns}
    arrays, copies, still = [], [], []
    for index, k in columns:
        name, values = OBJECTS[index][0], points.of_object(index)[:, k].tolist()
        rows = [values[i : i + _VALUES_PER_LINE] for i in range(0, last + 1, _VALUES_PER_LINE)]
        text = ",\n".join(f"    {', '.join(map(str, row))}" for row in rows)
        kind = f"ARRAY[0..{last}] OF {_type_of(index)}"
        arrays.append(f"  {name}_{k + 1} : {kind} := [\n{text}];")
        copies.append(f"  {name}[{k + 1}] := {name}_{k + 1}[Cycle];")
        still.append(f"  {name}[{k + 1}] := {rest.of_object(index)[0, k]};")
    text = Template(Path(__file__).with_name("motion.st").read_text(encoding="utf-8")).substitute(
        title=title.replace("*", ""),
        cycles=last + 1,
        cycle=f"{1e3 * drives.cycle_time:g}",
        outputs="\n".join(
            f"  {name} : ARRAY[1..{len(drives.axes)}] OF {kind}; (* {index} *)"
            for name, (index, kind) in outputs.items()
        ),
        last=last,
        arrays="\n".join(arrays),
        copies="\n".join(copies),
        still="\n".join(still),
    )
    write_text(path, text)


def _type_of(index: str) -> str:
    return "INT" if OBJECTS[index][1] == TORQUE else "DINT"


# --- cam tables ------------------------------------------------------------------------------


def cam_rows(samples: Samples, count: int) -> list[int]:
    """Return at most `count` rows whose cubics through position and speed approximate the samples.

    Each row is added in the middle of the interval whose cubic is farthest off [rad].
    """

    def gap(a: int, b: int) -> tuple[float, int, int]:
        ends = [a * samples.period, b * samples.period]
        cubic = PiecewisePolynomial.CubicHermite(ends, samples.q[[a, b]].T, samples.v[[a, b]].T)
        within = np.arange(a, b + 1) * samples.period
        return -np.abs(cubic.vector_values(within).T - samples.q[a : b + 1]).max(), a, b

    last = len(samples.q) - 1
    rows, gaps = {0, last}, [gap(0, last)]
    while len(rows) < count and gaps:
        _, a, b = heapq.heappop(gaps)
        middle = (a + b) // 2
        if middle > a:
            rows.add(middle)
            heapq.heappush(gaps, gap(a, middle))
            heapq.heappush(gaps, gap(middle, b))
    return sorted(rows)


def cam_table(robot: Robot, drives: Drives, samples: Samples, count: int) -> Integers:
    """Return a cam table of at most `count` points for cubics, without torques.

    Columns are the cycle (master), then positions [increments] and speeds [increments/s] of all
    axes.
    """
    rows, per_rad = cam_rows(samples, count), drives.increments_per_rad(robot)
    position = np.round(drives.zeros() + samples.q[rows] @ per_rad.T)
    table = np.hstack([np.array(rows)[:, None], position, np.round(samples.v[rows] @ per_rad.T)])
    return table.astype(np.int64)


def samples_from_cam(robot: Robot, drives: Drives, table: Integers) -> Samples:
    """Return the samples that a `cam_table` commands in each cycle by cubics, without torques."""
    per_joint, cycles = np.linalg.inv(drives.increments_per_rad(robot)).T, table[:, 0]
    position, speed = np.hsplit(table[:, 1:], 2)
    cubics = PiecewisePolynomial.CubicHermite(
        cycles * drives.cycle_time,
        ((position - drives.zeros()) @ per_joint).T,
        (speed @ per_joint).T,
    )
    t = np.arange(cycles[-1] + 1) * drives.cycle_time
    q, v = cubics.vector_values(t).T, cubics.derivative().vector_values(t).T
    return Samples(drives.cycle_time, q, v, np.zeros_like(q))


def write_cam(path: Path, table: Integers) -> None:
    """Write a `cam_table`."""
    axes = range(1, (table.shape[1] + 1) // 2)
    header = [f"{what}_{k}" for what in ("position", "speed") for k in axes]
    _write_integers(path, ["cycle", *header], table)


# --- ROS 2 -----------------------------------------------------------------------------------


def write_trajectory(
    path: Path, robot: Robot, samples: Samples, vd: Array, *, effort: bool
) -> None:
    """Write a trajectory_msgs/JointTrajectory as YAML, joint side in SI units, a point per line.

    Args:
        path: path of the file.
        robot: robot with the names of the joints.
        samples: points of the trajectory.
        vd: accelerations at the points [rad/s²], shape (N + 1, n).
        effort: True for points with torques.
    """
    fields = (*_FIELDS, "effort") if effort else _FIELDS
    with replacing(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(f"joint_names: {json.dumps(list(robot.joint_names))}\npoints:\n")
        for i, row in enumerate(zip(samples.q, samples.v, vd, samples.tau, strict=True)):
            nanoseconds = round(i * samples.period * 1e9)
            point = dict(zip(fields, (values.tolist() for values in row), strict=False))
            since = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
            text = json.dumps(point | {"time_from_start": since})
            # YAML 1.1, which ROS reads, parses 1e-05 as a text.
            text = _NO_POINT.sub(r"\1.0e", text)
            file.write(f"- {text}\n")


_FIELDS = ("positions", "velocities", "accelerations")
_NO_POINT = re.compile(r"(?<![.\d])(\d)e")


# --- integers --------------------------------------------------------------------------------


def _write_integers(path: Path, header: Sequence[str], table: Integers) -> None:
    with replacing(path) as partial, partial.open("w", encoding="ascii") as file:
        file.write(",".join(header) + "\n")
        file.writelines(",".join(map(str, row)) + "\n" for row in table.tolist())
