"""Gaps of a robot's file that only some uses notice: masses, and limits of the motors."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import Problem
from sdt_drake.io.shown import listed

MASSES, TORQUES, SPEEDS = "masses", "torque limits", "speed limits"
"""Kinds of problems: moving links without mass, joints without a known limit."""
PLANNING = MASSES, TORQUES, SPEEDS
"""Needs of planned motions and simulations."""


def lacks_of(
    file: Path, massless: Sequence[str], names: Sequence[str], effort_limit: Array,
    zero_speed: Sequence[str],
) -> tuple[Problem, ...]:  # fmt: skip
    """Return one problem for each kind of what a file lacks.

    Args:
        file: the file.
        massless: names of moving links without <inertial>.
        names: names of the joints.
        effort_limit: largest torque, joint side [N m], shape (n,); inf if none is known.
        zero_speed: names of joints whose <velocity> is 0 or less.
    """
    torqueless = [names[k] for k in np.flatnonzero(np.isinf(effort_limit)).tolist()]
    found = {
        MASSES: (massless, "link", "no <inertial>, expected mass and inertia, 0 if it has none"),
        TORQUES: (torqueless, "joint", "no torque limit known, expected a finite <effort> > 0"),
        SPEEDS: (zero_speed, "joint", "no speed limit known, expected a <velocity> > 0"),
    }
    return tuple(
        Problem(f"{file}: {listed(_quoted(kind, parts))}: {text}", kind=key)
        for key, (parts, kind, text) in found.items()
        if parts
    )


def told_zeros(zeros: dict[str, list[str]]) -> list[str]:
    """Return one sentence for each kind of limit that is 0 or less, by the joints' names."""
    return [
        f"{listed(_quoted('joint', names))}: <{tag}> of 0 or less is read as no known limit"
        for tag, names in zeros.items()
        if names
    ]


def _quoted(kind: str, names: Sequence[str]) -> list[str]:
    first, *others = [f"'{name}'" for name in names]
    return [f"{kind}{'s' * bool(others)} {first}", *others]
