"""What `identify` says of recordings with a fault put in on purpose, and of recordings without one.

    python tests/benchmarks/bench_suspicions.py            # 3 seeds of each fault, 25 without
    python tests/benchmarks/bench_suspicions.py 10 100     # more

Simulated robots (tests/helpers/simulated_recordings.py): links that are not as in the file, a
payload, friction with Stribeck, noise, encoders. A fault is "right" if it is named and nothing else
is, "also" if other suspicions are said beside it, "wrong" if only others are, "silent" if none are.
"""
# ruff: noqa: E402

import sys
from collections import Counter
from itertools import product
from pathlib import Path

from timing import head, row

COUNTED = ("right", "also", "silent", "wrong")
sys.path[:0] = [str(Path(__file__).parents[1])]

from helpers.faults import EXPECTED, blames, names, recording
from helpers.simulated_recordings import MOUNTINGS, ROBOTS

from sdt_drake.io.errors import InputError
from sdt_drake.machine.diagnose.finding import Finding
from sdt_drake.machine.identify.procedure import identify


def verdict(name: str, fault: str, seed: int) -> tuple[str, str]:
    """How a recording is judged, and the suspicions."""
    robot, recorded = recording(name, fault, seed)
    try:
        said = blames(identify(robot, [recorded]))
    except InputError as error:  # no links can be that have such torques
        said = [Finding(EXPECTED[fault][0] if fault else "", line) for line in error.lines]
    right = [one for one in said if fault and names(one, fault)]
    of_right = "right" if len(right) == len(said) else "also"
    return (of_right if right else "wrong" if said else "silent"), " / ".join(map(str, said))


def main(seeds: int = 3, clean: int = 25, *only: str) -> None:
    """Print the table."""
    head("fault", *COUNTED)
    for fault in only or ("", *EXPECTED):
        count: Counter[str] = Counter()
        robots = [x for x in ROBOTS if x != "sdt" or fault not in MOUNTINGS]
        for seed, name in product(range(seeds if fault else clean), robots):
            told, said = verdict(name, fault, seed + 100)
            count[told] += 1
            if told != "right" and said:
                print(f"  {fault} {name} {seed}: {told}: {said[:400]}", flush=True)
        row([fault or "none", *(count[told] for told in COUNTED)])


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:])
