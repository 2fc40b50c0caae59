"""What figures show, compared by their numbers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image

from sdt_drake.analysis.style import NUMBERS


def check_same_numbers(drawn: Path, committed: Path) -> None:
    """Two PNG show the same, to 0.2 % of the largest number of each line."""
    shown, expected = (json.loads(Image.open(path).text[NUMBERS]) for path in (drawn, committed))
    assert list(map(len, shown)) == list(map(len, expected)), f"draw {committed.name} again"
    for one, other in zip(shown, expected, strict=True):
        size = np.nanmax(np.abs(other), initial=1e-9)
        np.testing.assert_allclose(one, other, rtol=0, atol=2e-3 * size, err_msg=committed.name)
