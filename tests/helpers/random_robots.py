"""Random serial robots, as tables of Denavit and Hartenberg."""

import numpy as np
from oracles.dh import DhTable

_RIGHT = np.pi / 2


def random_table(seed: int) -> DhTable:
    """A serial robot of three to seven joints: heavy at the base, with or without rotors."""
    rng = np.random.default_rng([seed, 99])
    n, reach = int(rng.integers(3, 8)), rng.uniform(0.4, 1.4)
    a, d, alpha = np.zeros((3, n))
    for k in range(n):
        along = reach * 0.7**k * rng.uniform(0.3, 0.6)
        is_parallel = k in (1, 2) and rng.random() < 0.6
        alpha[k] = 0.0 if is_parallel else rng.choice([-_RIGHT, _RIGHT])
        a[k], d[k] = (along, 0.0) if is_parallel or k == 1 else (0.0, along)
    mass = rng.uniform(6, 30) * reach * 0.6 ** np.arange(n) * rng.uniform(0.7, 1.3, n)
    com = [tuple(np.array([-a[k], 0, -0.3 * d[k]]) * rng.uniform(0.3, 0.6) + rng.normal(0, 0.01, 3))
           for k in range(n)]  # fmt: skip
    com[-1] = (*rng.normal(0, rng.choice([0.002, 0.02]), 2), -0.03)
    torque = 9.81 * np.cumsum((mass * 0.5 * reach * 0.7 ** np.arange(n))[::-1])[::-1]
    gear = np.where(rng.random() < 0.4, 1.0, rng.uniform(50, 160, n).round())
    rotor = rng.choice([0.0, 1.0]) * torque / 100 / gear**2
    lists = {"a": a, "d": d, "alpha": alpha, "theta": rng.uniform(-1, 1, n), "mass": mass,
             "speed": np.full(n, 2.5), "effort": 3 * torque, "rotor_inertia": rotor,
             "gear_ratio": gear}  # fmt: skip
    com = [tuple(map(float, one)) for one in com]
    return DhTable(name=f"random{seed}", com=com, radius=0.06 * reach,
                   **{name: x.tolist() for name, x in lists.items()})  # fmt: skip
