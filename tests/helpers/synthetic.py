"""A study as the runner would write it, of formulas instead of simulations."""

import numpy as np
import pandas as pd

from sdt_drake.studies.table import StudyTable

CONTROLLERS = {"pi": 0.12, "pi_id": 0.01, "p_pi+id": 0.004}


def make_table(draws: int = 200, joints: int = 4) -> StudyTable:
    """Paired draws: run 3 d + c is draw d with controller c; 2 in 100 runs are infeasible.

    Speed errors grow with the payload and fall with omega_r; friction has no influence.
    """
    generator = np.random.default_rng(1)
    count = len(CONTROLLERS)
    n = count * draws
    inputs = {
        "omega_r": generator.uniform(20, 80, draws).repeat(count),
        "payload": generator.uniform(0, 120, draws).repeat(count),
        "friction": generator.uniform(0.5, 1.5, draws).repeat(count),
        "motion": generator.choice(["coriolis", "tumble"], draws).repeat(count),
        "controller": np.tile(list(CONTROLLERS), draws),
    }
    error = np.tile(list(CONTROLLERS.values()), draws) * 50 / inputs["omega_r"]
    error *= 1 + inputs["payload"] / 120 + 0.05 * generator.normal(size=n)
    outcomes = {}
    for k in range(1, joints + 1):
        outcomes |= {
            f"max_abs_speed_error_{k}": error * k,
            f"max_abs_position_error_{k}": 0.4 * error * k,
            f"constant_speed_error_{k}": np.where(inputs["motion"] == "tumble", np.nan, error),
            f"saturated_fraction_{k}": np.zeros(n),
            f"peak_torque_share_{k}": 0.5 + inputs["payload"] / 300 - 0.05 * k - error / 5,
            f"rms_torque_share_{k}": 0.2 + inputs["payload"] / 900 - error / 9,
        }
    outcomes["felt_share"] = np.clip(3 * error, 0, 1)
    status, reason = np.full(n, "ok", dtype="<U12"), np.full(n, "", dtype=object)
    for i in range(7, n, 50):
        status[i] = "infeasible"
        reason[i] = f"joint 2 needs {100 + i}.5 N m, expected at most 90 N m"
    for values in outcomes.values():
        values[status != "ok"] = np.nan
    choices = ("omega_r", "controller")
    return table_of(inputs, outcomes, status, reason, name="gains", choices=choices)


def small_table(y: np.ndarray, status: list[str] | None = None, **inputs) -> StudyTable:
    """One outcome, "y", and inputs."""
    own = {name: np.asarray(values) for name, values in inputs.items()}
    return table_of(own, {"y": np.asarray(y, dtype=float)}, status)


def table_of(inputs, outcomes, status=None, reason=None, *, name="small", choices=None):
    """A table of columns; runs are ok unless a status says something else."""
    n = len(next(iter(outcomes.values())))
    own = {"status": ["ok"] * n if status is None else status}
    own |= {"reason": [""] * n if reason is None else reason, "duration": np.full(n, 0.5)}
    runs = pd.DataFrame({**inputs, **own, **outcomes}).rename_axis("row")
    return StudyTable(name, runs, tuple(inputs), choices)
