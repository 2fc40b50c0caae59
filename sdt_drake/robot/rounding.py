"""Inertias that were rounded when a file was printed: the nearest that a body can have."""

import re
import xml.etree.ElementTree as ET

import numpy as np

from sdt_drake.io.arrays import Array

_DECIMALS = re.compile(r"[+-]?\d*\.?(\d*)(?:[eE]([+-]?\d+))?\s*")
_FEWEST = 3  # decimals of a 0.000 that is a rounded number, and not meant as none


def last_digit(link: ET.Element) -> float:
    """The last digit that is printed of a link's inertia [kg m²]; 0 for whole numbers, which are
    exact."""
    texts = [element.text or "" for element in link.findall("inertial/inertia/*")]
    found = [match for match in map(_DECIMALS.fullmatch, map(str.strip, texts)) if match]
    places = max((len(m[1]) - int(m[2] or 0) for m in found), default=0)
    return 10.0**-places if places > 0 else 0.0


def nearest_inertia(inertia: Array, digit: float) -> Array | None:
    """Find the nearest inertia that a body can have, where rounding alone has made another of it.

    The second moments Sigma = tr(I) / 2 E - I of a body are not negative. One that is below 0 by
    at most half a digit becomes 0, which moves no principal moment by more than a digit.

    Args:
        inertia: central [kg m²], shape (3, 3).
        digit: the last one that is printed [kg m²].

    Returns:
        The nearest inertia; None where more than rounding is wrong.
    """
    sigma, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    if sigma[0] < -digit / 2 * (1 + 1e-9):
        return None
    moments = axes * np.maximum(sigma, 0) @ axes.T
    nearest: Array = np.trace(moments) * np.eye(3) - moments
    return nearest


def fill_zeros(root: ET.Element) -> list[str]:
    """Give moments of inertia that are printed as 0.000 the most that they may be, in place.

    That is half of the last digit. Links without mass keep theirs.

    Returns:
        A sentence for each link that is another one.
    """
    told = []
    for link in root.iter("link"):
        digit, mass = last_digit(link), float(link.findtext("inertial/mass", "0"))
        moments = [e for e in link.findall("inertial/inertia/*") if e.tag in ("ixx", "iyy", "izz")]
        zeros = [e for e in moments if float(e.text or 0) == 0]
        if zeros and mass > 0 and 0 < digit <= 1.001 * 10.0**-_FEWEST:
            names = ", ".join(e.tag for e in zeros)
            told.append(
                f"link '{link.get('name')}': {names} printed as 0, taken as {digit / 2:g} kg m²"
            )
            for e in zeros:
                e.text = repr(digit / 2)
    return told
