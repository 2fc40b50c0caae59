"""Laws of friction that a joint may follow, linear in their parameters but for a shape.

The shape (a speed, a width) is one of few values over the range of speeds of the recording; the
rest is linear. Stribeck's term is that of `sdt_drake.robot.device`; sigmoid with an offset in
speed as in Petrone, Ferrentino, Chiacchio, "The dynamic model of the UR10 robot and its ROS2
integration", IEEE Trans. Industrial Informatics 2025.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.robot.device import stribeck

# Shares of the largest speed: widths of sigmoids, and of Stribeck's peak.
_WIDTHS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
_PEAKS = (0.005, 0.007, 0.01, 0.014, 0.02, 0.03, 0.04, 0.06, 0.1, 0.2, 0.4)
_OFFSETS = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)  # of the width of a sigmoid


@dataclass(frozen=True)
class Term:
    """A part of the friction of a joint, times a parameter.

    Attributes:
        kind: viscous [N m s/rad], viscous forwards (at v > 0 alone), and as forces [N m] coulomb,
            offset, stribeck, sigmoid.
        width: speed of a Stribeck peak, or of a sigmoid [rad/s].
        middle: speed at which a sigmoid is zero [rad/s].
    """

    kind: str
    width: float = 0.0
    middle: float = 0.0

    def at(self, v: Array, slowest: float) -> Array:
        """The torque of this term for a parameter of one, at speeds v [rad/s]; below `slowest`,
        signs fade."""
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
    """A candidate for the friction of a joint: `name`, and its terms."""

    name: str
    terms: tuple[Term, ...]

    @property
    def size(self) -> int:
        """How many numbers a fit chooses: parameters, widths and middles."""
        return len(self.terms) + sum((t.width > 0) + (t.kind == "sigmoid") for t in self.terms)


VISCOUS, COULOMB, OFFSET = Term("viscous"), Term("coulomb"), Term("offset")
USUAL = FrictionLaw("coulomb and offset", (VISCOUS, COULOMB, OFFSET))


def laws(fastest: float) -> tuple[FrictionLaw, ...]:
    """Candidate laws for a joint that moves at up to `fastest` [rad/s], the simpler ones first."""
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
    """The terms of several laws, each once."""
    return tuple(dict.fromkeys(term for law in candidates for term in law.terms))
