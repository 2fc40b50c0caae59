"""Reader of recordings into SI units, joint side."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sdt_drake.io.arguments import a_path, one_of
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.numbers import read_numbers
from sdt_drake.machine.recordings.columns import (
    ANGLES,
    RECORDED_SIGNALS,
    SIDES,
    TORQUES,
    Columns,
    load_columns,
)
from sdt_drake.machine.recordings.places import places_of
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.machine.recordings.times import times_of
from sdt_drake.motion.trajectory import interpolated
from sdt_drake.robot.robot import Robot

Recordings = Sequence[str | Path | Recorded] | str | Path | Recorded
"""One recording or several: files, or objects from `read_recording`."""

_OWN = ("tau_cmd", "tau_limited", "load_torque")  # columns that `simulate` writes


def read_recording(
    path: str | Path,
    robot: Robot,
    columns: Columns | str | Path | None = None,
    *,
    needs: Sequence[str] = ("q", "tau"),
    side: str | None = None,
) -> Recorded:
    """Read a recording of a robot.

        >>> import tempfile
        >>> from sdt_drake.robot.robot import load_robot
        >>> lines = ["time,q_1,q_2,q_3,q_4,tau_1,tau_2,tau_3,tau_4", "0,90,0,0,0,1,2,3,4"]
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder, "run.csv")
        ...     _ = path.write_text("\\n".join([*lines, "0.01,45,0,0,0,1,2,3,4"]))
        ...     recorded = read_recording(path, load_robot("sdt"), Columns(angle="deg"))
        >>> recorded.signals["q"][:, 0].round(4).tolist()  # rad
        [1.5708, 0.7854]

    Args:
        path: Path of the file.
        robot: The recorded robot, with its gear ratios.
        columns: Names and units of the columns, or a YAML file with them. Without them and with
            other names in the file, the error contains a proposal.
        needs: Signals of RECORDED_SIGNALS that must be there; others are read if present.
        side: Side of the torques, "joint" or "motor"; overrides `columns`. The default is the motor
            side for files of `simulate`, else the joint side.

    Raises:
        InputError: The file cannot be read. A column is missing, given twice or not finite. The
            number of joints differs. Times do not grow, or their steps are not those of a recorder.
            The error gives the file, and the column or line.
    """
    if side is not None:
        one_of(side, "side", SIDES)
    if columns is None:
        try:
            return read_recording(path, robot, Columns(), needs=needs, side=side)
        except InputError as error:
            raise _with_proposal(error, Path(path), robot) from None
    if not isinstance(columns, Columns):
        columns = load_columns(a_path(columns, "columns"))
    numbers = read_numbers(path, columns.style, logged=True)
    own = all(f"{name}_1" in numbers.names for name in _OWN)
    side = side or columns.side or ("motor" if own else "joint")
    time = times_of(numbers, columns)
    conversions = _conversions(robot.n, columns)
    signals = {}
    for name in RECORDED_SIGNALS:
        names = getattr(columns, name)
        is_named = bool(names) and names != getattr(Columns(), name)
        found = places_of(numbers, names, name, robot.n, needed=is_named or name in needs)
        if found:
            numbers.check_finite(found)
            signals[name] = numbers.data[:, found]
            if name == "tau" and columns.torque_delay != 0:
                signals[name] = interpolated(time + columns.torque_delay, time, signals[name])
            signals[name] *= conversions[name][0]  # in place, to save memory
            if side == "motor" and name in TORQUES:
                signals[name] = robot.joint_torque(signals[name])
            if columns.position_side == "motor" and name in ANGLES:
                signals[name] = robot.of_joints(signals[name])
            signals[name] += conversions[name][1]
    factor = columns.time_factor if columns.rate is None else None
    return Recorded(numbers.path, time, signals, own, factor, numbers.notes)


def recordings_of(
    given: Recordings,
    name: str,
    robot: Robot,
    columns: Columns | str | Path | None,
    *,
    needs: Sequence[str] = ("q", "tau"),
    side: str | None,
) -> list[Recorded]:
    """Return the recordings of an argument, read from their files if needed.

    Args:
        given: One recording or several, each a file or from `read_recording`.
        name: Name of the argument.
        robot, columns, needs, side: As in `read_recording`.

    Raises:
        InputError: As in `read_recording`, or for another type.
    """
    if isinstance(given, str | Path | Recorded):
        given = [given]
    if not isinstance(given, Sequence):
        kind = type(given).__name__
        raise InputError(f"a {kind}, expected a path or a list of paths", place=name)
    return [
        one
        if isinstance(one, Recorded)
        else read_recording(a_path(one, name), robot, columns, needs=needs, side=side)
        for one in given
    ]


def _with_proposal(error: InputError, path: Path, robot: Robot) -> InputError:
    """Return the error with a proposed mapping, if the file can be recognised."""
    from sdt_drake.machine.recordings.proposal import proposal

    if not path.is_file():
        return error
    try:
        proposed = proposal(path, robot.joint_names)
    except InputError:  # a binary file that cannot be read
        return error
    first, *others = error.problems
    return (
        InputError(first._replace(found=f"{first.found}; {proposed}"), *others)
        if proposed
        else error
    )


def _conversions(n: int, columns: Columns) -> dict[str, tuple[Array, Array]]:
    """Return factor and offset of each signal to SI units, shape (n,) each.

    Offsets are added on the joint side. Signs are those of the robot's file.
    """
    angle = np.pi / 180 if columns.angle == "deg" else 1.0
    direction, offset, torque = (
        np.full(n, default) if values is None else _each(values, name, n)
        for name, values, default in (
            ("direction", columns.direction, 1.0),
            ("position_offset", columns.position_offset, 0.0),
            ("torque_factor", columns.torque_factor, 1.0),
        )
    )
    factors = dict.fromkeys(ANGLES, angle * direction) | dict.fromkeys(TORQUES, torque * direction)
    return {
        name: (factor, offset if name in ("q", "q_ref") else np.zeros(n))
        for name, factor in factors.items()
    }


def _each(values: Sequence[float], name: str, n: int) -> Array:
    """Return one value for each of n joints."""
    if len(values) != n:
        raise InputError(f"{name}: {len(values)} value(s), but the robot has {n} joint(s)")
    return np.array(values)
