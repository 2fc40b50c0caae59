"""Reader of recordings into SI units, joint side."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from sdt_drake.io.arguments import a_path, one_of
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.numbers import Numbers, read_numbers
from sdt_drake.machine.recordings.columns import (
    ANGLE_UNITS,
    ANGLES,
    RECORDED_SIGNALS,
    SIDES,
    TORQUES,
    Columns,
    load_columns,
)
from sdt_drake.machine.recordings.joint_names import families, other_order
from sdt_drake.machine.recordings.places import OR_DROP, places_of
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.machine.recordings.times import places_of_time, times_of
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
            raise _with_proposal(error, Path(path), robot, needs) from None
    if not isinstance(columns, Columns):
        columns = load_columns(a_path(columns, "columns"))
    numbers = read_numbers(path, columns.style, logged=True)
    own = all(f"{name}_1" in numbers.names for name in _OWN)
    side = side or columns.side or ("motor" if own else "joint")
    places = _places(numbers, columns, robot.n, needs)
    by_names = _order_by_names(numbers, robot.joint_names, places)
    from_0 = _numbered_from_0(numbers, columns, places)
    if columns.drop_incomplete:
        numbers = numbers.complete([*places_of_time(numbers, columns), *chain(*places.values())])
    time = times_of(numbers, columns)
    signals = _signals(numbers, columns, places, robot, time, side)
    factor = columns.time_factor if columns.rate is None else None
    notes = (*numbers.notes, *from_0)
    return Recorded(numbers.path, time, signals, own, factor, columns, by_names, notes)


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


def _with_proposal(error: InputError, path: Path, robot: Robot, needs: Sequence[str]) -> InputError:
    """Return the error with a proposed mapping that was tried, if the file can be recognised."""
    from sdt_drake.machine.diagnose.angles import other_meanings
    from sdt_drake.machine.recordings.proposal import MAX_RADIANS, Proposal, proposal

    if not path.is_file():
        return error
    with suppress(InputError):  # a binary file that cannot be read
        proposed = proposal(path, robot.joint_names)
        if proposed is None:
            return error
        for more in ({}, {"drop_incomplete": True}):
            tried = replace(proposed, mapping=proposed.mapping | more)
            with suppress(InputError):
                read = read_recording(path, robot, Columns(**tried.mapping), needs=needs)
                largest = np.abs(read.signals["q"]).max()
                if largest > MAX_RADIANS and not tried.is_in_degrees:
                    angles = next(iter(other_meanings(robot, read)), None)
                    changes = angles.changes if angles else {"angle": "deg"}
                    words = f"{tried.words}; positions {angles.words if angles else 'in degrees'}"
                    tried = Proposal(words, tried.mapping | changes)
                    read = read_recording(path, robot, Columns(**tried.mapping), needs=needs)
                return tried.after(error, f": {_in_short(read)}")
    return error


def _in_short(recorded: Recorded) -> str:
    """Return the size of a recording in words."""
    q, lasts = recorded.signals["q"], float(recorded.time[-1])
    text = f"{len(q)} rows, {lasts:.4g} s at {1 / recorded.period:.4g} Hz"
    ranges = ", ".join(f"{x:.3g}" for x in np.degrees(np.ptp(q, axis=0)))
    return f"{text}, joints over {ranges} deg"


def _places(
    numbers: Numbers, columns: Columns, n: int, needs: Sequence[str]
) -> dict[str, list[int]]:
    """Return the places of the columns of each signal that is there."""
    places = {}
    for name in RECORDED_SIGNALS:
        names = getattr(columns, name)
        is_named = bool(names) and names != getattr(Columns(), name)
        found = places_of(numbers, names, name, n, needed=is_named or name in needs)
        if found:
            places[name] = found
    return places


def _signals(
    numbers: Numbers,
    columns: Columns,
    places: Mapping[str, list[int]],
    robot: Robot,
    time: Array,
    side: str,
) -> dict[str, Array]:
    """Return the signals in SI units, joint side, shape (N, n) each."""
    conversions, signals = _conversions(robot.n, columns), {}
    for name, found in places.items():
        numbers.check_finite(found, or_else=OR_DROP)
        signals[name] = numbers.data[:, found]
        if name == "tau" and columns.torque_delay != 0:
            signals[name] = interpolated(time + columns.torque_delay, time, signals[name])
        signals[name] *= conversions[name][0]  # in place, to save memory
        if side == "motor" and name in TORQUES:
            signals[name] = robot.joint_torque(signals[name])
        if columns.position_side == "motor" and name in ANGLES:
            signals[name] = robot.of_joints(signals[name])
        signals[name] += conversions[name][1]
    return signals


def _order_by_names(
    numbers: Numbers, joints: Sequence[str], places: Mapping[str, list[int]]
) -> dict[str, list[str]]:
    """Return the columns of signals whose names of joints tell another order, in that order."""
    texts = {numbers.names[place]: text for place, (_, text) in numbers.texts.items()}
    found = families(numbers.names, texts, joints)
    orders = {}
    for name, own in places.items():
        family = other_order([numbers.names[place] for place in own], found)
        if family is not None:
            orders[name] = family.columns
    return orders


def _numbered_from_0(
    numbers: Numbers, columns: Columns, places: Mapping[str, list[int]]
) -> list[str]:
    """Return a sentence on columns whose pattern has {k}, but which are numbered from 0."""
    first = [
        numbers.names[own[0]]
        for name, own in places.items()
        if "{k}" in (pattern := getattr(columns, name)[0])
        and numbers.names[own[0]] == pattern.replace("{k}", "0")
    ]
    return [f"columns are numbered from 0: joint 1 has {', '.join(first)}"] if first else []


def _conversions(n: int, columns: Columns) -> dict[str, tuple[Array, Array]]:
    """Return factor and offset of each signal to SI units, shape (n,) each.

    Offsets are added on the joint side. Signs are those of the robot's file.
    """
    angle = ANGLE_UNITS[columns.angle]
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
