"""The commands of `sdt-drake`, each a module: `add` declares its options, `run` does the work."""

from sdt_drake.commands import (
    bode,
    budget,
    compare,
    diagram,
    motions,
    pilot,
    plan,
    report,
    reproduce,
    simulate,
    size,
    stability,
    step,
    study,
    tune,
    view,
)

# As --help lists them.
COMMANDS = (
    reproduce,
    report,
    motions,
    plan,
    tune,
    step,
    simulate,
    compare,
    pilot,
    view,
    budget,
    bode,
    stability,
    study,
    size,
    diagram,
)
