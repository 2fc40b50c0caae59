"""Recordings of robots, read from files with any columns and units into SI units, joint side."""

from sdt_drake.machine.recordings.columns import (
    RECORDED_SIGNALS,
    SIDES,
    Columns,
    Layout,
    load_columns,
)
from sdt_drake.machine.recordings.places import missing, place_of
from sdt_drake.machine.recordings.reading import Recordings, read_recording, recordings_of
from sdt_drake.machine.recordings.recorded import Recorded, check_different
from sdt_drake.machine.recordings.times import other_unit, times_of

__all__ = [
    "RECORDED_SIGNALS", "SIDES", "Columns", "Layout", "Recorded", "Recordings", "check_different",
    "load_columns", "missing", "other_unit", "place_of", "read_recording", "recordings_of",
    "times_of",
]  # fmt: skip
