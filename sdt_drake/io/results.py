"""Tables of results as .csv or .json files, with units."""

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
    """A table of results. A .csv file has its columns only; a .json file has everything."""

    about: Mapping[str, object]
    """Values that apply to all rows, by name: texts, numbers, arrays, or mappings of them."""
    columns: "Mapping[str, ArrayLike]"
    """Columns by name: texts or numbers of shape (N,), or numbers of shape (N, n). Files have
    name_k for column k."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Units by name, in addition to UNITS."""

    def write(self, path: Path) -> None:
        """Write the table exactly, as .csv or .json. JSON has null for NaN and infinity.

        Raises:
            InputError: the file cannot be written.
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
"""Units of results by name. Inertias and gains are motor side; max, median and min are those along
a motion."""

RESULT_TABLES = (".csv", ".json")
"""Suffixes of the files that `Results` write."""
