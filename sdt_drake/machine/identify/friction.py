"""Candidate friction laws of a joint, linear in their parameters for a given shape.

The shape (a speed, a width) is one of a few values over the range of recorded speeds. The Stribeck
term is that of `sdt_drake.robot.device`. The sigmoid with an offset in speed is that of Petrone,
Ferrentino, Chiacchio, "The dynamic model of the UR10 robot and its ROS2 integration", IEEE Trans.
Industrial Informatics 2025.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.robot.device import stribeck

# Widths of sigmoids and of the Stribeck peak, over the largest speed.
_WIDTHS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
_PEAKS = (0.005, 0.007, 0.01, 0.014, 0.02, 0.03, 0.04, 0.06, 0.1, 0.2, 0.4)
PEAKS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.3)
"""Speeds of a scenario's Stribeck peak that are tried [rad/s]."""
_OFFSETS = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)  # zeros of a sigmoid over its width


@dataclass(frozen=True)
class Term:
    """A term of a friction law: a function of the speed, times a parameter."""

    kind: str
    """Kind: "viscous" or "viscous forwards" (only at v > 0), parameter in N m s/rad; "coulomb",
    "offset", "stribeck" or "sigmoid", parameter in N m."""
    width: float = 0.0
    """Speed of a Stribeck peak, or width of a sigmoid [rad/s]."""
    middle: float = 0.0
    """Speed at which a sigmoid is zero [rad/s]."""

    def at(self, v: Array, slowest: float) -> Array:
        """Return the torque for a parameter of 1 at speeds v [rad/s].

        The sign of Coulomb friction changes smoothly below `slowest` [rad/s].
        """
        if self.kind == "offset":
            return np.ones_like(v)
        if self.kind == "stribeck":
            return stribeck(v / self.width)
        if self.kind == "sigmoid":
            return np.tanh((v - self.middle) / self.width)
        sign = np.tanh(v / slowest)
        if self.kind == "coulomb":
            return sign
        return np.asarray(np.maximum(v, 0.0) if self.kind == "viscous forwards" else v)


@dataclass(frozen=True)
class FrictionLaw:
    """A candidate friction law of a joint."""

    name: str
    """Name in reports."""
    terms: tuple[Term, ...]
    """Terms of the sum."""

    @property
    def size(self) -> int:
        """Number of fitted values: parameters, widths and middles."""
        return len(self.terms) + sum((t.width > 0) + (t.kind == "sigmoid") for t in self.terms)


VISCOUS, COULOMB, OFFSET = Term("viscous"), Term("coulomb"), Term("offset")
USUAL = FrictionLaw("coulomb and offset", (VISCOUS, COULOMB, OFFSET))


def laws(fastest: float) -> tuple[FrictionLaw, ...]:
    """Return candidate laws for speeds up to `fastest` [rad/s], the simpler ones first."""
    found = [
        FrictionLaw("viscous", (VISCOUS,)),
        FrictionLaw("coulomb", (VISCOUS, COULOMB)),
        USUAL,
        FrictionLaw("asymmetric", (VISCOUS, COULOMB, OFFSET, Term("viscous forwards"))),
    ]
    for share in _PEAKS:
        peak = Term("stribeck", share * fastest)
        found.append(FrictionLaw("stribeck", (VISCOUS, COULOMB, OFFSET, peak)))
    for share in _WIDTHS:
        width = share * fastest
        for offset in _OFFSETS:
            sigmoid = Term("sigmoid", width, offset * width)
            found.append(FrictionLaw("sigmoid", (VISCOUS, OFFSET, sigmoid)))
            if share > _WIDTHS[0]:  # the narrowest is Coulomb friction itself
                found.append(
                    FrictionLaw("sigmoid and coulomb", (VISCOUS, COULOMB, OFFSET, sigmoid))
                )
    return tuple(sorted(found, key=lambda law: law.size))


def terms_of(candidates: Sequence[FrictionLaw]) -> tuple[Term, ...]:
    """Return the terms of several laws and of friction in scenarios, each once."""
    every = [*(law.terms for law in candidates), *map(scenario_terms, PEAKS)]
    return tuple(dict.fromkeys(term for terms in every for term in terms))


def scenario_terms(stribeck_speed: float) -> tuple[Term, ...]:
    """Return the terms of friction in a scenario with this speed of the Stribeck peak [rad/s]."""
    return (VISCOUS, COULOMB, OFFSET, Term("stribeck", stribeck_speed))
