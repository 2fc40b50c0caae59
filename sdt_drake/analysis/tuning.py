"""The numbers of a tuning under their name up to 0.4."""

from __future__ import annotations

import warnings

from sdt_drake.io.arrays import Array
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.scenario import Scenario


def tune(design: Design | Scenario) -> dict[str, Array]:
    """Return `design.tuning.numbers`; deprecated, goes in 0.7.

    >>> import sdt_drake as sdt
    >>> sdt.design(sdt.load("axis_pi")).tuning.numbers["ki"].round()  # [N m/rad], motor side
    array([  4640., 107000., 867000., 273000.])

    Raises:
        InputError: if `design` is neither a scenario nor its design, or cannot be resolved.
    """
    text = "sdt.tune(design) is design.tuning, its arrays are design.tuning.numbers; goes in 0.7"
    warnings.warn(text, DeprecationWarning, stacklevel=2)
    return as_design(design).tuning.numbers
