"""Load all URDFs of a folder, compare them with Pinocchio, and count what keeps others out.

    python tests/benchmarks/bench_published.py FOLDER

What a message names is tried: `hold` of joints that nothing drives here, `tip` of a tree.
"""

import logging
import re
import sys
from collections import Counter
from pathlib import Path

import numpy as np

import sdt_drake as sdt
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.robot.lacks import MASSES

sys.path.insert(0, str(Path(__file__).parents[1]))
from oracles.pinocchio_model import urdf_torque

HINTS = {"hold": re.compile("hold='([^']*)'"), "tip": re.compile("such as (.*?)(?:, | and )")}


def loaded(file):
    """The robot, what had to be held, and the problems that are left."""
    what = {}
    while True:
        try:
            return sdt.load_robot(file, **what), what, ()
        except sdt.InputError as error:
            hints = {name: hint.search(str(error)) for name, hint in HINTS.items()}
            new = {k: found[1] for k, found in hints.items() if found and k not in what}
            if not new:
                return None, what, error.problems
            what |= new


def difference(robot):
    """The largest difference of torques from Pinocchio's, over the largest torque [-]."""
    if any(problem.kind == MASSES for problem in robot.lacks):
        return 0.0
    q, v, vd = np.random.default_rng(0).uniform(-1, 1, (3, 5, robot.n))
    torque = torque_groups(robot, q, v, vd).total - robot.damping * v - vd @ robot.shared_inertia
    other = urdf_torque(robot, q, v, vd)
    return float(np.abs(torque - other).max() / max(np.abs(other).max(), 1e-9))


def main(folder):
    logging.disable()
    counts, reasons, worst = Counter(), Counter(), (0.0, "")
    for file in sorted(path for path in Path(folder).rglob("*") if path.suffix.lower() == ".urdf"):
        robot, what, problems = loaded(file)
        texts = [f"{one}".removeprefix(f"{file}: ") for one in problems]
        reasons.update({re.sub(r"'.*?'|-?\d+\.?\d*(e-?\d+)?", "_", text)[:80] for text in texts})
        counts["refused" if robot is None else ", ".join(what) or "as it is"] += 1
        if robot is not None:
            try:
                worst = max(worst, (difference(robot), str(file)))
            except ValueError:
                counts["not read by Pinocchio"] += 1
    print("files:", dict(counts))
    print(f"largest difference from Pinocchio: {worst[0]:.2g} of the largest torque, {worst[1]}")
    for reason, count in reasons.most_common():
        print(f"{count:5}  {reason}")


if __name__ == "__main__":
    main(*sys.argv[1:])
