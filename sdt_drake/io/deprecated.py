"""Names that work until 0.7."""

import warnings


def renamed(old: str, new: str) -> None:
    """Warn the caller's caller that a name has a new one."""
    warnings.warn(f"{old} is {new} now, and goes in 0.7", DeprecationWarning, stacklevel=3)
