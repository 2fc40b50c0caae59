"""Numbers that the paper publishes; only the verdicts on its claims depend on them.

Vidakovic, Kvrgic, et al., "Computed torque control for a spatial disorientation trainer", Facta
Universitatis, Series: Mechanical Engineering 18(2), 2020, doi 10.22190/FUME190919003V.
"""

OMEGA_R = 65.991
"""Lowest natural frequency of the structure [rad/s]: 10.5028 Hz, from CAE software (Section 4)."""

TABLE1: dict[str, tuple[str, ...]] = {
    "i_eff_max": ("4.26", "98.01", "796.3", "250.28"),
    "kp": ("267.1", "6.34e3", "5.2e4", "1.57e4"),
    "ki": ("4.64e3", "1.07e5", "8.67e5", "2.73e5"),
    "variation_percent": ("39.95", "31.82", "7.29", "25.4"),
    "zeta_max": ("0.95", "0.98", "0.99", "0.95"),
    "zeta_median": ("1.06", "1.07", "1.009", "1.017"),
    "zeta_min": ("1.23", "1.18", "1.03", "1.099"),
}
"""Table 1 as printed, joints 1 to 4. Inertia [kg m²] and gains [N m s/rad, N m/rad] motor side;
zeta [-] is at the largest, median and smallest effective inertia."""

FIGURE4: dict[str, dict[str, str]] = {
    "pi": {"rise_time": "0.022", "settling_time": "0.16", "overshoot_percent": "13.53"},
    "p_in_feedback": {"rise_time": "0.094", "settling_time": "0.159", "overshoot_percent": "0.0"},
}
"""Step responses of axis 1 [s, s, %] as printed in the text of Section 3.3."""

FIGURE4_ZETA: dict[str, float] = {"pi": 1.0, "p_in_feedback": 0.95}
"""Damping ratio of each structure in Figure 4 [-]."""

OMEGA_0_OVER_OMEGA_N = "0.32"
"""Oscillation over natural frequency for zeta = 0.95, as printed in Section 4 [-]."""

JOINT2_PI_MAX_ERROR: dict[str, str] = {"i_eff_max": "1.08", "i_eff_min": "1.204"}
"""Largest speed error of joint 2 with PI alone, by inertia of the process, as printed [rad/s]
(Section 4)."""


def table1(key: str) -> list[float]:
    """Return a column of Table 1 as numbers, joints 1 to 4."""
    return [float(text) for text in TABLE1[key]]
