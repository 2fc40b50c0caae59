"""The commands of `sdt-drake`, each a module: `add` declares its options, `run` does the work."""

from sdt_drake.commands import diagram, plan, reproduce, simulate, step, tune

COMMANDS = (reproduce, plan, tune, step, simulate, diagram)  # as --help lists them
