"""Coupled motors, as in wrists: a motor that turns with its own joint and with another one."""

import copy
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import listed

TURNS_WITH = "sdt:turns_with"
"""Element of a joint: turns of its motor per turn of another joint."""

_MAX_CONDITION = 1e6  # condition number of motor turns per joint turns


def coupling_of(root: ET.Element, names: Sequence[str], gear_ratio: Array, file: Path) -> Array:
    """Read the turns of each motor per turn of each joint [-], shape (n, n).

    Args:
        root: the <sdf> element.
        names: names of the joints, base to tip.
        gear_ratio: turns of each motor per turn of its own joint, shape (n,).
        file: the file, for messages.

    Raises:
        InputError: an unknown joint, a motor coupled to its own joint, or a singular coupling.
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
    if np.linalg.cond(coupling / gear_ratio[:, None]) > _MAX_CONDITION:
        raise InputError(
            f"{file}: <{TURNS_WITH}>: the coupling is singular, so that motors cannot turn each "
            "joint alone"
        )
    return coupling


def motor_inertia(coupling: Array, gear_ratio: Array, rotor_inertia: Array) -> Array:
    """Return the inertia of all motors that turn with each joint, seen by its own motor.

    Args:
        coupling: turns of each motor per turn of each joint [-], shape (n, n).
        gear_ratio: turns of each motor per turn of its own joint, shape (n,).
        rotor_inertia: I_m, motor side [kg m²], shape (n,).

    Returns:
        The diagonal of C' I_m C over r², motor side [kg m²], shape (n,).
    """
    return np.asarray(rotor_inertia @ (coupling / gear_ratio) ** 2)


def in_words(coupling: Array, names: Sequence[str]) -> list[str]:
    """Return one sentence for each coupled motor."""
    sentences = []
    for k, row in enumerate(coupling):
        others = [f"'{names[j]}' ({row[j]:.6g})" for j in np.flatnonzero(row).tolist() if j != k]
        if others:
            sentences.append(
                f"the motor of '{names[k]}' also turns with {listed(others)}: recordings, drive "
                "files and planned motions account for it, simulations for its rotor: simulated "
                "drives and friction turn one joint each"
            )
    return sentences


def without_coupling(root: ET.Element) -> ET.Element:
    """Copy an SDF without coupled motors, which Drake does not support."""
    root = copy.deepcopy(root)
    for joint in root.iter("joint"):
        for element in joint.findall(TURNS_WITH):
            joint.remove(element)
    return root
