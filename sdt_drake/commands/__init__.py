"""The commands of `sdt-drake`, each a module: `add` declares its options, `run` does the work."""

from sdt_drake.commands import (
    bode,
    budget,
    compare,
    diagram,
    plan,
    reproduce,
    simulate,
    stability,
    step,
    tune,
)

# As --help lists them.
COMMANDS = (reproduce, plan, tune, step, simulate, compare, budget, bode, stability, diagram)
