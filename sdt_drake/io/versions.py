"""Versions of all that the numbers depend on."""

from __future__ import annotations

import platform
from importlib import metadata

import numpy as np


def versions() -> dict[str, str]:
    """Versions of the package, Drake, numpy, scipy and Python."""
    return {
        "package": metadata.version("sdt_drake"),
        "drake": metadata.version("drake"),
        "numpy": np.__version__,
        "scipy": metadata.version("scipy"),
        "python": platform.python_version(),
    }


def other_versions(there: dict[str, str], here: dict[str, str]) -> str:
    """What is there in another version than here, for people; "" if nothing is."""
    other = [name for name in there if there[name] != here.get(name)]
    return ", ".join(f"{name} {there[name]} (here: {here.get(name)})" for name in other)
