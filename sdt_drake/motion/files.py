"""Where the files of motions are, and what is in them."""

from __future__ import annotations

from pathlib import Path

from sdt_drake.motion.profile import MotionProfile
from sdt_drake.resources import shipped
from sdt_drake.yaml_files import load_yaml


def load_profile(path: str | Path) -> MotionProfile:
    """A motion profile from YAML, or the shipped one of a name.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    profile, file = load_yaml(MotionProfile, path, "motion")
    profile.name = profile.name or file.stem
    return profile


def shipped_motions() -> list[str]:
    """Names of the training motions that ship with the package: those that a pilot feels."""
    return [name for name in shipped("motion") if load_profile(name).feels]
