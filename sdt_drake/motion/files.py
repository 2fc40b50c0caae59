"""Where the files of motions are, and what is in them."""

from __future__ import annotations

from pathlib import Path

from sdt_drake.errors import InputError
from sdt_drake.motion.profile import MotionProfile
from sdt_drake.resources import find_file, shipped
from sdt_drake.yaml_files import load_yaml, read_yaml


def load_profile(path: str | Path) -> MotionProfile:
    """A motion profile from YAML, or the shipped one of a name.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    try:
        profile, file = load_yaml(MotionProfile, path, "motion")
    except InputError:
        data = read_yaml(find_file(path, "motion"))
        if isinstance(data, dict) and "controller" in data:
            told = "is a scenario, expected a motion, like the one that it names"
            raise InputError(f"{path}: {told}") from None
        raise
    profile.name = profile.name or file.stem
    return profile


def shipped_motions() -> list[str]:
    """Names of the training motions that ship with the package: those that a pilot feels."""
    return [name for name in shipped("motion") if load_profile(name).feels]
