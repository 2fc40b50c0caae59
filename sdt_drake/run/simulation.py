"""The integrator of a run, by the fields of Drake's `SimulatorConfig`."""

from dataclasses import dataclass
from typing import Literal

from sdt_drake.io.fields import Input, Number, Problems, field

NO_ESTIMATE = ("explicit_euler", "runge_kutta2", "semi_explicit_euler")
"""Integrators without an estimate of their error, which take fixed steps alone."""


@dataclass(frozen=True)
class SimulationChoice(Input):
    """The integrator of a run: fields of Drake's `SimulatorConfig`."""

    integration_scheme: Literal[
        "runge_kutta3", "runge_kutta5", "bogacki_shampine3", "runge_kutta2", "explicit_euler",
        "semi_explicit_euler", "implicit_euler", "radau1", "radau3",
    ] = "runge_kutta3"  # fmt: skip
    """Name of the integrator in Drake. `velocity_implicit_euler` errs by 0.2 rad/s on the coupled
    plant, and is not accepted."""
    max_step_size: Number | None = field(None, ge=1e-6, le=1, unit="s")
    """Largest step. By default, and at most, a step goes from sample to sample."""
    accuracy: Number | None = field(None, ge=1e-12, le=0.01, unit="rad/s")
    """Accuracy of simulated speeds, moved to the scenario's `accuracy`, its short form."""
    use_error_control: bool = True
    """True for steps that keep the accuracy; False for fixed steps of `max_step_size`."""

    def problems(self) -> Problems:
        if self.use_error_control and self.integration_scheme in NO_ESTIMATE:
            text = f"true, but {self.integration_scheme} estimates no error, expected false"
            yield "use_error_control", text
        if not self.use_error_control and self.accuracy is not None:
            yield "accuracy", "no effect without use_error_control; remove"


BY_DEFAULT = SimulationChoice()
"""The integrator of runs by default."""
