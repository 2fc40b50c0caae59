"""Versions of the software that results depend on."""

import platform
from importlib import metadata

import numpy as np


def versions() -> dict[str, str]:
    """Return the versions of the package, Drake, numpy, scipy and Python."""
    return {
        "package": metadata.version("sdt_drake"),
        "drake": metadata.version("drake"),
        "numpy": np.__version__,
        "scipy": metadata.version("scipy"),
        "python": platform.python_version(),
    }


def other_versions(there: dict[str, str], here: dict[str, str]) -> str:
    """Return the versions in `there` that differ from `here`, as text; "" if none.

    >>> other_versions({"drake": "1.50", "numpy": "2.1"}, {"drake": "1.51", "numpy": "2.1"})
    'drake 1.50 (here: 1.51)'
    """
    other = [name for name in there if there[name] != here.get(name)]
    return ", ".join(f"{name} {there[name]} (here: {here.get(name)})" for name in other)
