"""Names that work until 0.7."""

import warnings


def renamed(old: str, new: str, stacklevel: int = 3) -> None:
    """Warn the caller's caller that a name has a new one; more levels up with `stacklevel`."""
    warnings.warn(f"{old} is {new} now, and goes in 0.7", DeprecationWarning, stacklevel)
