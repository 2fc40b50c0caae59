"""The commands of `sdt-drake`, each a module.

The docstring of its `run` is its help, with an example; the parameters are its options.
"""

COMMANDS = (
    "reproduce", "report", "init", "scenarios", "motions", "plan", "export", "tune", "step",
    "simulate", "compare", "pilot", "excite", "identify", "replay", "view", "budget", "bode",
    "stability", "study", "size", "learn", "fly", "diagram", "reference",
)  # fmt: skip
"""In the order of --help."""
