"""Where the files of motions are, and what is in them."""

from __future__ import annotations

import difflib
from pathlib import Path, PurePath

from sdt_drake.errors import InputError
from sdt_drake.fields import beside
from sdt_drake.motion.profile import MotionProfile
from sdt_drake.resources import PACKAGE_PREFIX, models_dir
from sdt_drake.yaml_files import load_yaml


def load_profile(path: str | Path) -> MotionProfile:
    """A motion profile from YAML, or the shipped one of a name.

    Raises:
        InputError: naming the file, the field, and what would be right.
    """
    profile, file = load_yaml(MotionProfile, find_motion(path))
    profile.name = profile.name or file.stem
    return profile


def shipped_motions() -> list[str]:
    """Names of the training motions that ship with the package: those that a pilot feels."""
    names = (file.stem for file in sorted((models_dir() / "motions").glob("*.yaml")))
    return [name for name in names if load_profile(name).feels]


def motion_beside(name: str, folder: Path) -> str:
    """What a YAML file in `folder` means by a motion: a shipped one by its name, or a file."""
    return name if find_motion(name) != name else beside(name, folder)


def find_motion(name_or_path: str | Path) -> str:
    """The path of a motion: `graveyard_spin` is package://sdt/motions/graveyard_spin.yaml.

    What has a suffix or a slash is a path already.

    Raises:
        InputError: if no motion of that name is shipped; it lists near ones.
    """
    text = str(name_or_path)
    if not text or PurePath(text).suffix or PurePath(text).name != text:
        return text
    names = sorted(file.stem for file in (models_dir() / "motions").glob("*.yaml"))
    if text not in names:
        near = difflib.get_close_matches(text, names, n=3)
        hint = f"did you mean {' or '.join(near)}?" if near else f"shipped: {', '.join(names)}"
        raise InputError(f"{text}: no such motion, {hint} (files end in .yaml or .csv)")
    return f"{PACKAGE_PREFIX}motions/{text}.yaml"
