"""Effective inertia along a motion and tuned gains, by name."""

from __future__ import annotations

from sdt_drake.io.arrays import Array
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.scenario import Scenario
from sdt_drake.systems.gains import damping_ratio, natural_frequency, oscillation_frequency


def tune(design: Design | Scenario) -> dict[str, Array]:
    """Return the effective inertia along a motion and the tuned gains, as `sdt-drake tune`.

    >>> import sdt_drake as sdt
    >>> sdt.tune(sdt.load("axis_pi"))["ki"].round()  # [N m/rad], motor side
    array([  4640., 107000., 867000., 273000.])

    Args:
        design: a scenario or its design.

    Returns:
        Arrays of shape (n,) by name, motor side. Inertia: i_eff_max, i_eff_median, i_eff_min
        [kg m²], variation_percent [%]. Gains: kp [N m s/rad], ki [N m/rad]. At each of the three
        inertias: damping ratio zeta_max, zeta_median, zeta_min [-] and natural frequency
        omega_n_max, omega_n_median, omega_n_min [rad/s]. At the largest: omega_0 [rad/s].

    Raises:
        InputError: if `design` is neither, or the scenario cannot be resolved.
    """
    design = as_design(design)
    inertia, gains = design.inertia, design.gains
    numbers = {
        "i_eff_max": inertia.maximum,
        "i_eff_median": inertia.median,
        "i_eff_min": inertia.minimum,
        "variation_percent": inertia.variation_percent,
        "kp": gains.kp,
        "ki": gains.ki,
    }
    for level, i_eff in zip(("max", "median", "min"), list(numbers.values())[:3], strict=True):
        numbers[f"zeta_{level}"] = damping_ratio(gains, i_eff)
        numbers[f"omega_n_{level}"] = natural_frequency(gains, i_eff)
    return numbers | {"omega_0": oscillation_frequency(gains, inertia.maximum)}
