"""Motors that turn with another joint than their own, too, as those of wrists do."""

import copy
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import listed

TURNS_WITH = "sdt:turns_with"
"""Element of a joint: how often its motor turns in a turn of another joint, beside its own."""

_MOST_COUPLED = 1e6  # condition number of motors over joints


def coupling_of(root: ET.Element, names: Sequence[str], gear_ratio: Array, file: Path) -> Array:
    """Read how often each motor turns in a turn of each joint [-], shape (n, n).

    Args:
        root: <sdf> and all below.
        names: of the joints, base to tip.
        gear_ratio: of each motor and its own joint, shape (n,).
        file: what errors name.

    Raises:
        InputError: for a joint that is none or its own, or motors that leave a joint alone.
    """
    coupling = np.diag(gear_ratio)
    for joint in root.iter("joint"):
        name = joint.get("name", "")
        for element in joint.findall(TURNS_WITH):
            where, other = f"{file}: joint '{name}': <{TURNS_WITH}>", element.get("joint", "")
            if name not in names or other not in names or name == other:
                others = ", ".join(x for x in names if x != name)
                raise InputError(f"{where} joint='{other[:40]}', expected another of {others}")
            coupling[names.index(name), names.index(other)] = float(element.text or 0)
    if np.linalg.cond(coupling / gear_ratio[:, None]) > _MOST_COUPLED:
        raise InputError(f"{file}: <{TURNS_WITH}>: the motors cannot turn the joints one by one")
    return coupling


def in_words(coupling: Array, names: Sequence[str]) -> list[str]:
    """Tell of each motor that turns with another joint, a sentence each."""
    told = []
    for k, row in enumerate(coupling):
        others = [f"'{names[j]}' ({row[j]:.6g})" for j in np.flatnonzero(row).tolist() if j != k]
        if others:
            told.append(
                f"the motor of '{names[k]}' turns with {listed(others)}, too: motor sides of "
                "recordings and drive files, and limits of planned motions have it; simulated "
                "motors turn their own joint alone"
            )
    return told


def without_coupling(root: ET.Element) -> ET.Element:
    """Copy an SDF as Drake reads it, which knows no coupled motors."""
    root = copy.deepcopy(root)
    for joint in root.iter("joint"):
        for element in joint.findall(TURNS_WITH):
            joint.remove(element)
    return root
