"""What `identify` says of recordings with a fault put in on purpose, and of recordings without one.

    python tests/benchmarks/bench_suspicions.py            # 3 seeds of each fault, 25 without
    python tests/benchmarks/bench_suspicions.py 10 100     # more

Simulated robots (tests/machine/simulated_recordings.py): links that are not as in the file, a
payload, friction with Stribeck, noise, encoders. A fault is "right" if it is named and nothing else
is, "also" if other suspicions are said beside it, "wrong" if only others are, "silent" if none are.
"""
# ruff: noqa: E402

import sys
from collections import Counter
from itertools import product
from pathlib import Path

import numpy as np
from timing import head, row

COUNTED = ("right", "also", "silent", "wrong")
TESTS = Path(__file__).parents[1]
sys.path[:0] = [str(TESTS), str(TESTS / "machine")]

import simulated_recordings as simulated

from sdt_drake.io.errors import InputError
from sdt_drake.machine.diagnose.finding import Finding
from sdt_drake.machine.identify.procedure import identify

NEUTRAL = {"beyond limit", "at limit", "excitation", "still", "inconsistent"}
"""Kinds of findings that blame no recording."""

EXPECTED = {
    "jitter": ("uneven", ""),
    "rounded": ("rounded", ""),
    "missing": ("missing", ""),
    "repeated": ("repeated", ""),
    "held": ("held", "torque_delay: "),
    "frozen_q": ("frozen", "q_"),
    "frozen_tau": ("frozen", "tau_"),
    "clipped": ("clipped", ""),
    "speeds_in_degrees": ("speeds", "in degrees"),
    "speeds_of_motors": ("speeds", "those of the motor"),
    "speeds_late": ("late speeds", ""),
    "clock": ("clock", ""),
    "degrees": ("degrees", "angle: deg"),
    "torque_late": ("late torques", ""),
    "torque_of_one_late": ("residual", "joint 2: "),
    "kilo": ("unit", "in kN m"),
    "milli": ("unit", "in N mm"),
    "motor_side": ("unit", "of the motors"),
    "amperes": ("unit", "a current"),
    "per_mille": ("unit", "per mille"),
    "swapped": ("columns", "tau_2 and tau_3 swapped"),
    "reversed_order": ("columns", "from the tip to the base"),
    "torque_sign": ("columns", "with the opposite sign"),
    "direction": ("columns", "the opposite direction of joint"),
    "zero": ("columns", "an offset of q_2"),
    "ceiling": ("columns", "upside down"),
    "wall": ("columns", "as on a wall"),
    "tilt": ("columns", "turned by 20 degrees"),
    "drift": ("residual", "friction"),
    "hysteresis": ("residual", "builds up over an angle"),
    "spring": ("residual", "acts on its position"),
}
"""The kind of the finding for each fault, and words of its sentence or remedy."""


def recording(name: str, fault: str, seed: int):
    """Robot of the file and recording of a fault; "" for none."""
    mounting = fault if fault in simulated.MOUNTINGS else ""
    truth = simulated.truth(name, seed, mounting)
    if not fault or mounting:
        return truth.robot, truth.recorded
    made = {"kilo": simulated.scaled(1e-3), "milli": simulated.scaled(1e3)}
    put_in = made.get(fault) or getattr(simulated, fault)
    return truth.robot, put_in(truth, np.random.default_rng([seed, 7]))


def blames(found) -> list[Finding]:
    """Findings of an identification that blame its recording."""
    return [one for one in found.findings if one.kind not in NEUTRAL]


def names(one: Finding, fault: str) -> bool:
    """True if a finding names a fault."""
    kind, words = EXPECTED[fault]
    return one.kind == kind and words in str(one)


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
        robots = [x for x in simulated.ROBOTS if x != "sdt" or fault not in simulated.MOUNTINGS]
        for seed, name in product(range(seeds if fault else clean), robots):
            told, said = verdict(name, fault, seed + 100)
            count[told] += 1
            if told != "right" and said:
                print(f"  {fault} {name} {seed}: {told}: {said[:400]}", flush=True)
        row([fault or "none", *(count[told] for told in COUNTED)])


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:])
