"""Correction of inertias that became impossible by rounding when the file was printed."""

import re
import xml.etree.ElementTree as ET

import numpy as np

from sdt_drake.io.arrays import Array

_DECIMALS = re.compile(r"[+-]?\d*\.?(\d*)(?:[eE]([+-]?\d+))?\s*")
_MIN_DECIMALS = 3  # 0.000 is a rounded number, 0.0 is an exact zero


def last_digit(link: ET.Element) -> float:
    """Return the last printed digit of a link's inertia [kg m²]; 0 for whole numbers (exact)."""
    texts = [element.text or "" for element in link.findall("inertial/inertia/*")]
    found = [match for match in map(_DECIMALS.fullmatch, map(str.strip, texts)) if match]
    places = max((len(m[1]) - int(m[2] or 0) for m in found), default=0)
    return 10.0**-places if places > 0 else 0.0


def nearest_inertia(inertia: Array, digit: float) -> Array | None:
    """Find the nearest possible inertia of one that became impossible by rounding.

    The second moments Sigma = tr(I) / 2 E - I of a body are >= 0. A moment below 0 by at most half
    a digit becomes 0. This changes principal moments by at most one digit.

    Args:
        inertia: central inertia [kg m²], shape (3, 3).
        digit: last printed digit [kg m²].

    Returns:
        The nearest inertia; None if more than rounding is wrong.
    """
    sigma, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    if sigma[0] < -digit / 2 * (1 + 1e-9):
        return None
    moments = axes * np.maximum(sigma, 0) @ axes.T
    nearest: Array = np.trace(moments) * np.eye(3) - moments
    return nearest


def fill_zeros(root: ET.Element) -> list[str]:
    """Set moments of inertia printed as 0.000 to half of the last digit, in place.

    Links without mass do not change.

    Returns:
        One sentence for each changed link.
    """
    sentences = []
    for link in root.iter("link"):
        digit, mass = last_digit(link), float(link.findtext("inertial/mass", "0"))
        moments = [e for e in link.findall("inertial/inertia/*") if e.tag in ("ixx", "iyy", "izz")]
        zeros = [e for e in moments if float(e.text or 0) == 0]
        if zeros and mass > 0 and 0 < digit <= 1.001 * 10.0**-_MIN_DECIMALS:
            names = ", ".join(e.tag for e in zeros)
            sentences.append(
                f"link '{link.get('name')}': {names} printed as 0, set to {digit / 2:g} kg m²"
            )
            for e in zeros:
                e.text = repr(digit / 2)
    return sentences
