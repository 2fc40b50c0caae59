"""Motions as files for drives (CiA 402), PLCs (IEC 61131-3) and ROS 2."""

from sdt_drake.machine.drive_files.drives import Axis, Drives, load_drives
from sdt_drake.machine.drive_files.export import (
    FILES,
    READ_BACK,
    Playback,
    cycles_in_a_period,
    export,
    play_back,
    write_files,
)
from sdt_drake.machine.drive_files.formats import write_drive_table
from sdt_drake.machine.drive_files.set_points import (
    Samples,
    SetPoints,
    samples_from,
    samples_of,
    set_points,
)

__all__ = [
    "FILES", "READ_BACK", "Axis", "Drives", "Playback", "Samples", "SetPoints",
    "cycles_in_a_period", "export", "load_drives", "play_back", "samples_from", "samples_of",
    "set_points", "write_drive_table", "write_files",
]  # fmt: skip
