"""Faults of simulated recordings: put in by name, and the finding that names each."""

import re

import numpy as np

from helpers import simulated_recordings as simulated
from helpers.more_faults import MORE, REAL, real
from sdt_drake.machine.diagnose.finding import Finding

NEUTRAL = {"beyond limit", "at limit", "excitation", "still", "inconsistent", "payload"}
"""Kinds of findings that blame no recording."""

EXPECTED = {
    "logger_clock": ("uneven", "another column of time"),
    "rounded": ("rounded", ""),
    "missing": ("missing", ""),
    "repeated": ("repeated", ""),
    "held": ("held", "torque_delay: "),
    "frozen_q": ("frozen", "q_"),
    "frozen_tau": ("frozen", "tau_"),
    "frozen_all_q": ("frozen", "q: all joints"),
    "frozen_all_tau": ("frozen", "tau: all joints"),
    "clipped": ("clipped", ""),
    "speeds_in_degrees": ("speeds", "in degrees"),
    "speeds_of_motors": ("speeds", "those of the motor"),
    "speeds_late": ("late speeds", ""),
    "clock": ("clock", ""),
    "degrees": ("degrees", "angle: deg"),
    "of_motors": ("degrees", "position_side: motor"),
    "torque_late": ("late torques", ""),
    "torque_of_one_late": ("residual", "joint 2: "),
    "kilo": ("unit", "in kN m"),
    "milli": ("unit", "in N mm"),
    "motor_side": ("unit", "of the motors"),
    "amperes": ("unit", "a current"),
    "per_mille": ("unit", "per mille"),
    "swapped": ("columns", "tau_2 and tau_3 swapped"),
    "reversed_order": ("columns", "from the tip to the base"),
    "shuffled": ("columns", "all columns in another order"),
    "shuffled_torques": ("columns", "torques in another order"),
    "shuffled_positions": ("columns", "positions in another order"),
    "torque_sign": ("columns", "with the opposite sign"),
    "direction": ("columns", "the opposite direction of joint"),
    "zero": ("columns", "an offset of q_2"),
    "ceiling": ("columns", "upside down"),
    "wall": ("columns", "as on a wall"),
    "tilt": ("columns", "turned by (19|20|21) degrees"),
    "drift": ("residual", "friction"),
    "hysteresis": ("residual", "builds up over an angle"),
    "spring": ("residual", "acts on its position"),
    "percent": ("unit", "percent"),
    "swapped_at_wrist": ("columns", "swapped"),
    "swapped_positions": ("columns", "positions in another order"),
    "swapped_joints": ("columns", "swapped"),
    "all_signs": ("columns", "all torques with the opposite sign"),
    "position_sign": ("columns", "opposite"),
    "zero_10": ("columns", "an offset of q_2"),
    "one_in_milli": ("unit", "tau_2"),
    "wrong_gear": ("unit", "tau_2"),
    "no_gravity": ("columns", "without gravity"),
    "picked_up": ("held out", "payload"),
    "saturated": ("clipped", "tau_2"),
    "torque_filtered": ("late torques", ""),
    "positions_late": ("late torques", ""),
    "counts": ("degrees", ""),
    "turns": ("degrees", "in turns"),
    "speeds_in_rpm": ("speeds", "rpm"),
    "speed_sign": ("speeds", "opposite sign"),
    "milliseconds": ("milliseconds", ""),
    "coupled_motors": ("residual", "turns with"),
}
"""The kind of the finding for each fault, and an expression for its sentence or remedy."""


def recording(name: str, fault: str, seed: int):
    """Robot of the file and recording of a fault; "" for none."""
    mounting = fault if fault in simulated.MOUNTINGS else ""
    truth = real(name, mounting) if name in REAL else simulated.truth(name, seed, mounting)
    if not fault or mounting:
        return truth.robot, truth.recorded
    made = {"kilo": simulated.scaled(1e-3), "milli": simulated.scaled(1e3)}
    put_in = (made | MORE).get(fault) or getattr(simulated, fault)
    return truth.robot, put_in(truth, np.random.default_rng([seed, 7]))


def blames(found) -> list[Finding]:
    """Findings of an identification that blame its recording."""
    return [one for one in found.findings if one.kind not in NEUTRAL]


def names(one: Finding, fault: str) -> bool:
    """True if a finding names a fault."""
    kind, words = EXPECTED[fault]
    return one.kind == kind and bool(re.search(words, str(one)))
