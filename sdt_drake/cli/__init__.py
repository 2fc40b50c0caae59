"""The commands of `sdt-drake`, each a module.

Its docstring says what it does, EXAMPLE shows it; `add` declares its options, `run` does the work.
"""

COMMANDS = (
    "reproduce", "report", "init", "scenarios", "motions", "plan", "export", "tune", "step",
    "simulate", "compare", "pilot", "excite", "identify", "replay", "view", "budget", "bode",
    "stability", "study", "size", "learn", "diagram", "reference",
)  # fmt: skip
"""In the order of --help."""
