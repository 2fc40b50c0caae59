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
from sdt_drake.machine.identify.procedure import identify

NEUTRAL = (
    "wrong side (--side) or unit", "at its limit", "hardly excited", "too little excitation",
    "stands still", "physically consistent links",
)  # fmt: skip
"""Warnings that blame no recording."""

EXPECTED = {
    "jitter": "uneven sampling",
    "rounded": "times were rounded",
    "missing": "are missing",
    "repeated": "repeat the one before",
    "held": "torque_delay: ",
    "frozen_q": "frozen",
    "frozen_tau": "frozen",
    "clipped": "clipped",
    "speeds_in_degrees": "in degrees",
    "speeds_of_motors": "those of the motor",
    "speeds_late": "speeds are",
    "clock": "is a second of the clock",
    "degrees": "angle: deg",
    "torque_late": "torques are recorded late",
    "torque_of_one_late": "joint 2: ",
    "kilo": "in kN m",
    "milli": "in N mm",
    "motor_side": "of the motors",
    "amperes": "a current",
    "per_mille": "per mille",
    "swapped": "tau_2 and tau_3 swapped",
    "reversed_order": "from the tip to the base",
    "torque_sign": "with the opposite sign",
    "direction": "the opposite direction of joint",
    "zero": "an offset of q_2",
    "ceiling": "upside down",
    "wall": "as on a wall",
    "tilt": "turned by 20 degrees",
    "drift": "friction",
    "hysteresis": "builds up over an angle",
    "spring": "acts on its position",
}
"""What is to be said of each fault."""


def recording(name: str, fault: str, seed: int):
    """Robot of the file and recording of a fault; "" for none."""
    mounting = fault if fault in simulated.MOUNTINGS else ""
    truth = simulated.truth(name, seed, mounting)
    if not fault or mounting:
        return truth.robot, truth.recorded
    made = {"kilo": simulated.scaled(1e-3), "milli": simulated.scaled(1e3)}
    put_in = made.get(fault) or getattr(simulated, fault)
    return truth.robot, put_in(truth, np.random.default_rng([seed, 7]))


def verdict(name: str, fault: str, seed: int) -> tuple[str, str]:
    """How a recording is judged, and the suspicions."""
    robot, recorded = recording(name, fault, seed)
    try:
        lines = identify(robot, [recorded]).warnings
    except InputError as error:  # no links can be that have such torques
        lines = tuple(error.lines)
    said = [line for line in lines if not any(words in line for words in NEUTRAL)]
    right = [line for line in said if fault and EXPECTED[fault] in line]
    of_right = "right" if len(right) == len(said) else "also"
    return (of_right if right else "wrong" if said else "silent"), " / ".join(said)


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
