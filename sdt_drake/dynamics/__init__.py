"""Inverse dynamics by torque groups, their decoupling into loads, and effective inertia."""

from sdt_drake.dynamics.decoupling import SIGNS, Loads, decouple
from sdt_drake.dynamics.effective_inertia import (
    InertiaRange,
    effective_inertia,
    where_largest,
)
from sdt_drake.dynamics.inverse import (
    TorqueGroups,
    gravity_stiffness,
    groups_of_sample,
    inverse_dynamics,
    torque_groups,
)

__all__ = [
    "SIGNS",
    "InertiaRange",
    "Loads",
    "TorqueGroups",
    "decouple",
    "effective_inertia",
    "gravity_stiffness",
    "groups_of_sample",
    "inverse_dynamics",
    "torque_groups",
    "where_largest",
]
