"""Mapping files: how a recording's file is read, and what it calls its columns."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from sdt_drake.io.fields import (
    EachJoint,
    Input,
    Names,
    Number,
    OneOf,
    Positive,
    Problems,
    SomeNames,
    setting,
)
from sdt_drake.io.numbers import Style
from sdt_drake.io.yaml_files import load_yaml

SIDES = ("joint", "motor")
DECIMALS = {"point": ".", "comma": ","}
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": None}
ANGLES = ("q", "v", "q_ref", "v_ref", "vd_ref")
TORQUES = ("tau", "tau_mean", "tau_ff")
RECORDED_SIGNALS = (*ANGLES, *TORQUES)
"""Of each joint: position, speed, torque of the motor, its mean over the period that ends there;
what was asked for; torque fed forward."""


@dataclass
class Layout(Input):
    """How a file of columns is read, and how it says when its rows are."""

    delimiter: Annotated[str, OneOf(tuple(DELIMITERS))] = "comma"
    """Between columns: comma, semicolon, tab or space (any blanks)."""
    header: bool = True
    """Whether a line with names comes first."""
    decimal: Annotated[str, OneOf(tuple(DECIMALS))] = "point"
    """Decimal mark in the numbers: point or comma."""
    encoding: str = "utf-8"
    """Encoding of the letters, such as latin-1 or utf-16."""
    skip: int = setting(0, ge=0, le=1000, unit="-")
    """Lines before that."""
    time: str = "time"
    """Column of the time; "" where there is none, but a rate."""
    time_factor: Positive = setting(1.0, unit="s")
    """What a 1 in that column is."""
    rate: Positive | None = setting(None, unit="Hz")
    """Samples in a second, where there is no time."""

    @property
    def style(self) -> Style:
        """How its text is written."""
        delimiter, decimal = DELIMITERS[self.delimiter], DECIMALS[self.decimal]
        return Style(delimiter, self.header, self.skip, decimal, self.encoding)

    def problems(self) -> Problems:
        if self.decimal == self.delimiter == "comma":
            yield "decimal", "comma, expected another than the delimiter"
        try:
            "".encode(self.encoding)
        except (LookupError, ValueError):
            yield "encoding", f"'{self.encoding}', expected one such as utf-8, latin-1, utf-16"
        if (self.time == "") == (self.rate is None):
            text = (
                "missing, expected one where time is empty" if not self.time else "needs time: ''"
            )
            yield "rate", text


@dataclass
class Columns(Layout):
    """How a recording's file says what it holds; the default is that of this package.

    A signal is a list of columns, one for each joint from the base to the tip, by their names or,
    counted from 1, their numbers; or one text in which {k} stands for the number of the joint, from
    1: `q: Axis{k}.Position`. What is not there has none: [].
    """

    q: SomeNames = setting(["q_{k}"])
    """Columns of the positions."""
    v: Names = setting(["v_{k}"])
    """Columns of the speeds, which are not needed."""
    tau: SomeNames = setting(["tau_{k}"])
    """Columns of the torques."""
    tau_mean: Names = setting(["tau_mean_{k}"])
    """Columns of the mean torques since the sample before; `identify` prefers them."""
    q_ref: Names = setting(["q_ref_{k}"])
    """Columns of the position reference, for `replay`."""
    v_ref: Names = setting(["v_ref_{k}"])
    """Columns of the speed reference, likewise."""
    vd_ref: Names = setting(["vd_ref_{k}"])
    """Columns of the acceleration reference, likewise."""
    tau_ff: Names = setting(["tau_ff_{k}"])
    """Columns of the torque feedforward, likewise."""
    angle: Annotated[str, OneOf(("rad", "deg"))] = "rad"
    """"rad" or "deg", of positions and speeds."""
    position_side: Annotated[str, OneOf(SIDES)] = "joint"
    """"joint" or "motor", of positions, speeds and accelerations; those of motors are divided by
    the gear ratios."""
    side: Annotated[str, OneOf(SIDES)] | None = None
    """"joint" or "motor", of torques. That of a recording of `simulate` is known."""
    position_offset: EachJoint[Number] | None = setting(None, unit="rad", side="joint")
    """Added to q and q_ref; 0 by default."""
    direction: EachJoint[Annotated[Number, Field(ge=-1, le=1)]] | None = setting(None, unit="-")
    """1, or -1 for a joint whose positions, speeds and torques are counted the other way than
    in the robot's file; 1 by default."""
    torque_delay: Number = setting(0.0, ge=-1, le=1, unit="s")
    """By how much tau is recorded later than positions, as half the period of a drive that
    holds it."""
    torque_factor: EachJoint[Number] | None = setting(None, unit="N m per unit")
    """What turns the columns of torques, perhaps currents, into torques; 1 by default."""

    def problems(self) -> Problems:
        yield from Layout.problems(self)
        if any(abs(x) != 1 for x in self.direction or []):
            yield "direction", f"{self.direction}, expected 1 and -1"
        if any(x == 0 for x in self.torque_factor or []):
            yield "torque_factor", f"{self.torque_factor}, expected no 0"


def load_columns(path: str | Path) -> Columns:
    """The mapping file of a recording.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    return load_yaml(Columns, path)[0]
