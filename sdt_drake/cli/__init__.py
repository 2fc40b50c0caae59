"""The commands of `sdt-drake`, one module each.

The docstring of the module's `run` is the help text, its parameters are the options.
"""

COMMANDS = (
    "reproduce", "report", "init", "scenarios", "motions", "plan", "export", "tune", "step",
    "simulate", "compare", "pilot", "excite", "identify", "replay", "view", "budget", "bode",
    "stability", "study", "size", "learn", "fly", "diagram", "reference", "docs",
)  # fmt: skip
"""The names of the commands, in the order of --help."""
