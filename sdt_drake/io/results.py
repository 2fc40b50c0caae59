"""Numbers of a design as files, with their units."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from sdt_drake.io.files import write_csv, write_text
from sdt_drake.io.formats import flat, in_json

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True, eq=False)
class Results:
    """Numbers of a design, to be written as .csv, the columns alone, or as .json.

    Attributes:
        about: what holds for all rows, by name: texts, numbers, arrays, or mappings of them.
        columns: by name: texts or numbers of shape (N,), or numbers of shape (N, n), of which
            column k is called name_k.
        units: by name, of what UNITS does not know.
    """

    about: Mapping[str, object]
    columns: Mapping[str, ArrayLike]
    units: Mapping[str, str] = field(default_factory=dict)

    def write(self, path: Path) -> None:
        """Write them exactly, as the suffix says; what is not finite is null in .json.

        Raises:
            InputError: if the file cannot be written.
        """
        import numpy as np

        columns = flat({name: np.asarray(values) for name, values in self.columns.items()})
        lists = {name: values.tolist() for name, values in columns.items()}
        if path.suffix != ".json":
            write_csv(path, lists, zip(*lists.values(), strict=True))
            return
        known = {**UNITS, **self.units}
        units = {x: known[x] for x in (*self.about, *self.columns) if x in known}
        whole = in_json({**self.about, "units": units, "columns": lists})
        write_text(path, json.dumps(whole, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


UNITS = {
    name: unit
    for unit, names in {
        "s": "time rise_time settling_time peak_time",
        "rad/s": "omega omega_r omega_0 omega_n_max omega_n_median omega_n_min bandwidth crossover "
        "peak_omega v peak steady_state_error",
        "kg m²": "inertia i_eff_max i_eff_median i_eff_min",
        "N m s/rad": "kp",
        "N m/rad": "ki",
        "-": "zeta zeta_max zeta_median zeta_min ratio damping damping_ratio unstable_from "
        "tracking_magnitude loop_gain_magnitude gain_margin gain_reduction modulus_margin",
        "%": "overshoot_percent variation_percent",
        "deg": "tracking_phase loop_gain_phase phase_margin",
        "dB": "peak_db",
    }.items()
    for name in names.split()
}
"""Of the numbers of a design, by name. Inertias and gains are motor side; max, median and min are
those along a motion."""

RESULT_TABLES = (".csv", ".json")
"""Kinds of files that `Results` are written as."""
