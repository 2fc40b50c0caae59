"""What `identify` says of recordings with a fault put in on purpose, and of recordings without one.

    python tests/benchmarks/bench_suspicions.py [SEEDS] [CLEAN] [FAULT...]

Simulated robots (tests/helpers/simulated_recordings.py, random_robots.py): links that are not as in
the file, a payload, friction with Stribeck, noise, encoders. Where they are there, the published
recordings of two real robots get faults, too. A fault is "right" if it is named and nothing else
is, "also" if other suspicions are said beside it, "wrong" if only others are, "silent" if none are.
CLEAN random robots are without a fault: all that is said of them is wrong. Tools that the file
lacks are no faults: what blames their recordings is wrong. Returns the share of faults that are
named, of clean recordings with suspicions, and of tools that are taken for something else.
"""
# ruff: noqa: E402

import sys
from collections import Counter
from pathlib import Path

from timing import head, row

COUNTED = ("right", "also", "silent", "wrong")
sys.path[:0] = [str(Path(__file__).parents[1])]

from helpers.faults import EXPECTED, blames, names, recording
from helpers.more_faults import REAL, TOOLS, UNREAL, with_tool
from helpers.simulated_recordings import MOUNTINGS, ROBOTS
from oracles.dh import DATA

from sdt_drake.io.errors import InputError
from sdt_drake.machine.diagnose.finding import Finding
from sdt_drake.machine.identify.procedure import identify


def verdict(name: str, fault: str, seed: int) -> tuple[str, str]:
    """How a recording is judged, and the suspicions."""
    try:
        robot, recorded = recording(name, fault, seed)
        said = blames(identify(robot, [recorded]))
    except InputError as error:  # no links can be that have such torques
        said = [Finding(EXPECTED[fault][0] if fault else "", line) for line in error.lines]
    right = [one for one in said if fault and names(one, fault)]
    of_right = "right" if len(right) == len(said) else "also"
    return (of_right if right else "wrong" if said else "silent"), " / ".join(map(str, said))


def main(seeds: int = 1, clean: int = 40, *only: str) -> dict[str, float]:
    """Print the table, and return the shares."""
    head("fault", *COUNTED)
    every: Counter[str] = Counter()
    for i, fault in enumerate(only or EXPECTED):
        count: Counter[str] = Counter()
        robots = [x for x in (*ROBOTS, *(REAL if DATA.is_dir() else ()))
                  if (x != "sdt" or fault not in MOUNTINGS) and (x in ROBOTS or fault not in UNREAL)
                  ]  # fmt: skip
        for seed in range(seeds):
            name = robots[(i + seed) % len(robots)]
            told, said = verdict(name, fault, seed + 100)
            count[told] += 1
            if told != "right":
                print(f"  {fault} {name} {seed}: {told}: {said[:400]}", flush=True)
        every += count
        row([fault, *(count[told] for told in COUNTED)])
    row(["all", *(every[told] for told in COUNTED)])
    false = 0
    for seed in range(clean):
        told, said = verdict(f"random{seed}", "", seed)
        false += told != "silent"
        if said:
            print(f"  clean random{seed}: {said[:400]}", flush=True)
    row(["none", "", "", clean - false, false])
    wrong = 0
    for name, share in () if only else TOOLS:
        if name not in REAL or DATA.is_dir():
            robot, recorded = with_tool(name, share)
            said = blames(identify(robot, [recorded]))
            wrong += bool(said)
            if said:
                print(f"  tool {name} {share}: {' / '.join(map(str, said))[:400]}", flush=True)
    row(["tools", "", "", len(TOOLS) - wrong, wrong])
    named = (every["right"] + every["also"]) / max(1, every.total())
    return {
        "faults named": named,
        "false alarms": false / max(1, clean),
        "tools blamed": wrong / len(TOOLS),
    }


if __name__ == "__main__":
    print(main(*map(int, sys.argv[1:3]), *sys.argv[3:]))
