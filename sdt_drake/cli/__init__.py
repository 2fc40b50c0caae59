"""The commands of `sdt-drake`, one module each.

The docstring of the module's `run` is the help text, its parameters are the options. Subcommands
are further functions of the module.
"""

GROUPS = {
    "Start": ("reproduce", "init", "list", "docs"),
    "Simulate": ("simulate", "compare", "view", "diagram"),
    "Control": ("tune", "step", "bode", "stability", "budget"),
    "Motion and pilot": ("plan", "pilot", "fly", "stops"),
    "Real machine": ("excite", "identify", "judge", "replay", "learn", "export", "accept"),
    "Many runs": ("study", "size"),
}
"""The names of the commands by their job, most used first, as in --help."""

COMMANDS = tuple(name for names in GROUPS.values() for name in names)
"""The names of the commands, in the order of --help."""

SUBCOMMANDS = {
    "reproduce": ("report",),
    "list": ("motions",),
    "docs": ("files",),
    "pilot": ("validate", "people"),
    "learn": ("update",),
    "export": ("fmu",),
    "accept": ("plan", "judge", "predict"),
    "study": ("run", "show", "repeat"),
}
"""The names of subcommands by their command. `accept` and `study` have no other form."""
