"""Parts, gains and control law of a scenario that differ from the machine's, by a replay."""

from collections.abc import Iterator

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import formatted, listed
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.finding import Finding, finding, kinds
from sdt_drake.machine.replay import ALONE, FEEDFORWARD, QUANTITIES, Replay


def check_replay(replay: Replay) -> Iterator[Finding]:
    """Yield the changes that explain a recording better, and joints with another controller."""
    for quantity in replay.measured:
        as_it_is = replay.explained(quantity)
        for case, is_better in replay.better(quantity).items():
            joints = tuple(k + 1 for k in np.flatnonzero(is_better).tolist())
            share = replay.explained(quantity, case)[is_better]
            own = as_it_is[is_better]
            words = {
                "subject": case if case == FEEDFORWARD else f"simulation {case}",
                "quantity": QUANTITIES[quantity].title, "of": listed(list(map(str, joints))),
                "now": _percent(share), "before": _percent(own),
                "why": kinds()["scenario"]["why"][case],
            }  # fmt: skip
            shares = {"explained": float(share.min()), "explained_before": float(own.min())}
            yield finding("scenario", joints, **words, **shares)
    if ALONE in replay.courses:
        apart = replay.apart("torque", ALONE)
        off = replay.difference("torque", ALONE) > replay.recorded_rms("torque")
        # False for joints without a torque
        wrong = np.flatnonzero(off & (replay.explained("torque") < c.EXPLAINED_SHARE)).tolist()
        if wrong:
            numbers = [k + 1 for k in wrong]
            times = {f"times_{k + 1}": float(apart[k]) for k in wrong}
            yield finding("controller", numbers, of=", ".join(map(str, numbers)), **times)


def _percent(shares: Array) -> str:
    """Return shares in percent, with a dash for negative ones."""
    return " ".join(formatted(100 * x if x >= 0 else np.nan, ".1f") for x in shares.tolist())
