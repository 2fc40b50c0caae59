"""Mapping files: the format of a recording's file, and the names of its columns."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

from pydantic import Field

from sdt_drake.io import fields
from sdt_drake.io.numbers import Style
from sdt_drake.io.yaml_files import load_yaml

Side = Literal["joint", "motor"]
SIDES: tuple[Side, ...] = get_args(Side)
DECIMALS = {"point": ".", "comma": ","}
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": None, "pipe": "|"}
ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180, "turn": 2 * math.pi}  # [rad]
ANGLES = ("q", "v", "q_ref", "v_ref", "vd_ref")
TORQUES = ("tau", "tau_mean", "tau_ff")
RECORDED_SIGNALS = (*ANGLES, *TORQUES)
"""Signals of each joint: position, speed, references of position, speed and acceleration. Motor
torque, its mean over the sample period before, torque feedforward."""


@dataclass(frozen=True)
class Layout(fields.Input):
    """The format of a file of columns, and the time of its rows."""

    delimiter: Literal["comma", "semicolon", "tab", "space", "pipe", ",", ";", "|"] = "comma"
    """Delimiter between columns: comma, semicolon, tab, space (any blanks) or pipe; or itself."""
    header: bool = True
    """True if a line with column names comes first."""
    units: bool = False
    """True if a line with units comes after the names; it is not read."""
    decimal: Literal["point", "comma"] = "point"
    """Decimal mark in the numbers: point or comma."""
    encoding: str = "utf-8"
    """Encoding of the text, such as latin-1 or utf-16."""
    skip: int = fields.field(0, ge=0, le=1000, unit="-")
    """Number of lines to skip before the header or the first row."""
    time: str = "time"
    """Column of the time, in numbers, dates or times of day; "" if the file has none, then give
    `rate`."""
    time_factor: fields.Positive = fields.field(1.0, unit="s")
    """Unit of the time column: 0.001 for milliseconds."""
    nanoseconds: str = ""
    """Column of nanoseconds to add to a time in whole seconds, as stamps of ROS 2 have; "" for
    none."""
    rate: fields.Positive | None = fields.field(None, unit="Hz")
    """Sample rate of a file without a time column."""
    drop_incomplete: bool = False
    """True to leave out rows without a number in a column that is read, such as gaps of NaN."""

    @property
    def style(self) -> Style:
        """Format of the text."""
        delimiter = DELIMITERS.get(self.delimiter, self.delimiter)
        decimal = DECIMALS[self.decimal]
        return Style(delimiter, self.header, self.units, self.skip, decimal, self.encoding)

    def problems(self) -> fields.Problems:
        if self.decimal == "comma" and self.delimiter in ("comma", ","):
            yield "decimal", "comma is the delimiter, too; expected point, or another delimiter"
        try:
            "".encode(self.encoding)
        except (LookupError, ValueError):
            yield "encoding", f"'{self.encoding}', expected one such as utf-8, latin-1, utf-16"
        if (self.time == "") == (self.rate is None):
            missing = "missing, expected a rate because time is ''"
            yield "rate", "expected only with time: ''" if self.time else missing
        if self.units and not self.header:
            yield "units", "expected only with header: true; else skip the line"


@dataclass(frozen=True)
class Columns(Layout):
    """The columns of a recording's file, with their units; the default is the package's own format.

    A signal is a list of columns, one for each joint from base to tip. Columns are given by name,
    or by number from 1. Cells with lists, such as "[1.0, 2.0]" in q, are read as columns q_1 and
    q_2. One text with {k} for the number of the joint, from 1, or {k0}, from 0, stands for the
    whole list: `q: Axis{k}.Position`. An empty list, [], is a signal that the file does not have.
    """

    q: fields.NonEmptyNames = fields.field(("q_{k}",))
    """Columns of the positions."""
    v: fields.Names = fields.field(("v_{k}",))
    """Columns of the speeds (optional)."""
    tau: fields.NonEmptyNames = fields.field(("tau_{k}",))
    """Columns of the torques."""
    tau_mean: fields.Names = fields.field(("tau_mean_{k}",))
    """Columns of the mean torques over the sample period before; `identify` prefers them."""
    q_ref: fields.Names = fields.field(("q_ref_{k}",))
    """Columns of the position reference, for `replay`."""
    v_ref: fields.Names = fields.field(("v_ref_{k}",))
    """Columns of the speed reference, for `replay`."""
    vd_ref: fields.Names = fields.field(("vd_ref_{k}",))
    """Columns of the acceleration reference, for `replay`."""
    tau_ff: fields.Names = fields.field(("tau_ff_{k}",))
    """Columns of the torque feedforward, for `replay`."""
    angle: Literal["rad", "deg", "turn"] = "rad"
    """Unit of positions and speeds: "rad", "deg" or "turn" (revolutions)."""
    position_side: Side = "joint"
    """Side of positions, speeds and accelerations: "joint" or "motor". Those of motors are divided
    by the gear ratios."""
    side: Side | None = None
    """Side of torques: "joint" or "motor". The default is the motor side for recordings of
    `simulate`, else the joint side."""
    position_offset: fields.EachJoint[fields.Number] | None = fields.field(
        None, unit="rad", side="joint"
    )
    """Values added to q and q_ref of each joint; 0 by default."""
    direction: fields.EachJoint[Annotated[fields.Number, Field(ge=-1, le=1)]] | None = fields.field(
        None, unit="-"
    )
    """Direction of each joint: 1, or -1 if positions, speeds and torques have the opposite sign
    of the robot's file; 1 by default."""
    torque_delay: fields.Number = fields.field(0.0, ge=-1, le=1, unit="s")
    """Delay of recorded torques behind positions, such as half the period of a drive that holds
    them."""
    torque_factor: fields.EachJoint[fields.Number] | None = fields.field(None, unit="N m per unit")
    """Factor from each torque or current column to N m; 1 by default."""

    def problems(self) -> fields.Problems:
        yield from Layout.problems(self)
        if any(abs(x) != 1 for x in self.direction or []):
            yield "direction", f"{self.direction}, expected 1 and -1"
        if any(x == 0 for x in self.torque_factor or []):
            yield "torque_factor", f"{self.torque_factor}, expected no 0"


def load_columns(path: str | Path) -> Columns:
    """Load the mapping file of a recording.

    Raises:
        InputError: A field is bad; the error gives the file, the field and the accepted values.
    """
    return load_yaml(Columns, path)[0]
