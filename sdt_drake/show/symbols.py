"""Symbols of this package's blocks in block diagrams."""

import yaml  # a dependency of Drake
from pydrake.systems.framework import System

from sdt_drake.show.diagrams import Symbols
from sdt_drake.show.sections import TEMPLATES


def _encoder(block: System) -> str:
    timing = block.GetUniquePeriodicDiscreteUpdateAttribute()
    if timing is None:  # an ideal one, not drawn
        return ""
    return f"encoder\n{1e3 * timing.period_sec():g} ms"


PAPER = {
    "load_torque": "tau_LD",
    "alleviating_torque": "tau_alleviate",
    "motor_speed_ref": "q\u0307_mr",
    "motor_speed": "q\u0307_m",
}
"""The paper's symbols of signals, by name of the output."""

SYMBOLS: Symbols = {
    **yaml.safe_load((TEMPLATES / "symbols.yaml").read_text("utf-8")),
    "dynamic_saturation": lambda block: "dynamic\n" * (block.num_input_ports() > 1) + "saturation",
    "encoder.drives": _encoder,
    "encoder.samples": _encoder,
}
"""Symbols by name of the system or class, in the form of `sdt_drake.show.diagrams.walk`."""
