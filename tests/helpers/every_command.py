"""Every command, and a line with which it works."""

from helpers.command_line import AXIS, RUN, SHORT_MOTION
from sdt_drake.cli import COMMANDS, SUBCOMMANDS

POSITIONAL = {
    "plan": SHORT_MOTION, "export": f"{SHORT_MOTION} --drive drives", "export fmu": RUN,
    "tune": SHORT_MOTION, "pilot": RUN, "pilot people": "post_roll", "excite": "sdt",
    "identify": "sdt all.csv", "judge": "sdt all.csv", "replay": f"all.csv {RUN}", "view": RUN,
    "study run": "monte_carlo", "study show": "mc", "study repeat": "mc --row 0", "init": "new",
    "size": "sizing", "learn": RUN, "learn update": f"s all.csv --scenario {RUN}",
    "accept plan": "../given/coupled.yaml", "accept judge": "../given all.csv",
    "accept predict": "../given/coupled.yaml", "fly": "sdt turn --out flown",
    "stops": "../given/coupled.yaml",
    **dict.fromkeys(("simulate", "compare", "bode", "diagram"), RUN),
    **dict.fromkeys(("budget", "stability"), AXIS),
}  # fmt: skip
"""What each command is about."""
EVERY = [
    name
    for command in COMMANDS
    for name in (command, *(f"{command} {sub}" for sub in SUBCOMMANDS.get(command, ())))
    if name not in ("accept", "study")  # have subcommands alone
]
