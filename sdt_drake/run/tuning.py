"""The tuning of a controller: gains and torque feedforward, from its model of the robot."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import Figure, Shown, Summary, higher, of_joints
from sdt_drake.motion import Motion
from sdt_drake.robot.device import FrictionParameters, friction_parameters, sliding_friction
from sdt_drake.robot.dynamics import InertiaRange, effective_inertia
from sdt_drake.robot.robot import Robot
from sdt_drake.run.plant import steady, torques_along
from sdt_drake.run.reference import Reference
from sdt_drake.run.scenario import Scenario
from sdt_drake.systems.gains import (
    SpeedGains,
    damping_ratio,
    feedforward_torque,
    natural_frequency,
    oscillation_frequency,
    tune,
)


@dataclass(frozen=True, eq=False)
class FeedforwardLaw:
    """The torque feedforward of a model: gain feedforward_torque + friction(v_ref) / r."""

    kind: str
    """One of `sdt_drake.systems.gains.FEEDFORWARDS`."""
    gain: Array | float
    """Factor on the torque of that kind [-], shape (n,)."""
    model: Robot
    """Robot whose torques are fed forward."""
    sign: str
    """Sign of Algorithm 1's third branch, one of `sdt_drake.robot.dynamics.SIGNS`."""
    friction: FrictionParameters | None
    """Friction that is compensated; None for none."""

    def __call__(self, groups: Sequence[Array], v: Array, vd: Array) -> Array:
        """Return the torque, motor side [N m], shape (n,) or (N, n).

        Args:
            groups: torque groups of the model (Eq. 2), joint side [N m]: inertial, reaction,
                velocity, gravity.
            v: reference speed, joint side [rad/s].
            vd: reference acceleration, joint side [rad/s²].
        """
        tau_ff = self.gain * feedforward_torque(self.kind, self.model, groups, vd, self.sign)
        if self.friction is None:
            return tau_ff
        return tau_ff + sliding_friction(self.friction, v) / self.model.gear_ratio

    def along(self, motion: Motion) -> Array:
        """Return the torque along a motion, motor side [N m], shape (N + 1, n)."""
        torques = torques_along(self.model, motion)
        groups = (torques.inertial, torques.reaction, torques.velocity, torques.gravity)
        return self(groups, motion.v, motion.vd)


@dataclass(frozen=True, eq=False)
class Feedforward:
    """A torque feedforward, motor side; none by default."""

    along: Array | None = None
    """Torque at the samples of the motion [N m], shape (N + 1, n); None without feedforward."""
    steady: Array | float = 0.0
    """Torque in steady motion at the initial speed, where a run starts [N m], shape (n,). A learned
    torque has no part in it."""
    law: FeedforwardLaw | None = None
    """Law of the torque, apart from a learned one; None if it is given by its samples alone."""

    def steady_at(self, start: Motion) -> Array | float:
        """Return the torque of the law in steady motion at a sample [N m], shape (n,)."""
        return 0.0 if self.law is None else self.law.along(start)[0]


@dataclass(frozen=True, eq=False, repr=False)
class Tuning(Shown):
    """Gains and feedforward of a controller, tuned to its model along the motion; motor side."""

    model: Robot
    """The controller's model of the robot."""
    motion: Motion
    """The motion that the controller tracks."""
    i_eff: Array
    """Effective inertia of the model along the motion [kg m²], shape (N + 1, n)."""
    omega_r: float | None
    """Lowest natural frequency of the device's structure [rad/s]; None if gains are given."""
    gains: SpeedGains
    """Gains of the PI speed controllers, tuned to the largest inertia."""
    position_gain: Array
    """K_V of the position loops [1/s], shape (n,)."""
    feedforward: Feedforward
    """Torque feedforward: the controller's own, or the one that replaces it."""

    @cached_property
    def inertia(self) -> InertiaRange:
        """Range of the effective inertia of the model along the motion."""
        return InertiaRange.of(self.i_eff)

    @property
    def omega_n(self) -> Array:
        """Natural frequency of the speed loops at the largest inertia [rad/s], shape (n,)."""
        return natural_frequency(self.gains, self.inertia.maximum)

    @property
    def inertia_share(self) -> Array:
        """Effective inertia over its largest value along the motion [-], shape (N + 1, n)."""
        return self.i_eff / self.inertia.maximum

    @property
    def numbers(self) -> dict[str, Array]:
        """Arrays of shape (n,) by name, as `sdt-drake tune --out` writes them.

        Inertia: i_eff_max, i_eff_median, i_eff_min [kg m²], variation_percent [%]. Gains: kp
        [N m s/rad], ki [N m/rad]. At each of the three inertias: damping ratio zeta_max,
        zeta_median, zeta_min [-] and natural frequency omega_n_max, omega_n_median, omega_n_min
        [rad/s]. At the largest: omega_0 [rad/s].
        """
        inertia, gains = self.inertia, self.gains
        levels = {"max": inertia.maximum, "median": inertia.median, "min": inertia.minimum}
        numbers = {f"i_eff_{level}": i_eff for level, i_eff in levels.items()}
        numbers |= {"variation_percent": inertia.variation_percent, "kp": gains.kp, "ki": gains.ki}
        for level, i_eff in levels.items():
            numbers[f"zeta_{level}"] = damping_ratio(gains, i_eff)
            numbers[f"omega_n_{level}"] = natural_frequency(gains, i_eff)
        return numbers | {"omega_0": oscillation_frequency(gains, inertia.maximum)}

    def summary(self) -> Summary:
        found = self.numbers
        columns = {
            "I_eff max [kg m²]": (".5g", found["i_eff_max"]),
            "min [kg m²]": (".5g", found["i_eff_min"]),
            "K_PS [N m s/rad]": (".4g", found["kp"]),
            "K_IS [N m/rad]": (".4g", found["ki"]),
            "zeta at max [-]": (".3f", found["zeta_max"]),
            "at min [-]": (".3f", found["zeta_min"]),
            "omega_n [rad/s]": (".4g", found["omega_n_max"]),
        }
        omega_r = "" if self.omega_r is None else f", omega_r = {self.omega_r:g} rad/s"
        title = f"for {self.motion.in_time}{omega_r}; motor side"
        return of_joints(title, columns, self.model.joint_names)

    def plot(self) -> Figure:
        """Return a figure of the effective inertia along the motion, motor side."""
        draw = higher("show.figures.runs:effective_inertia")
        title = f"{self.model.name}: effective inertia, motor side"
        return draw(title, self.motion.time, self.i_eff, self.model.joint_names)


def tuning_of(
    scenario: Scenario, model: Robot, reference: Reference, override: Feedforward | None = None
) -> Tuning:
    """Return the tuning of a scenario's controller.

    Args:
        scenario: gives kp and ki, or omega_r, omega_ratio and zeta; and the feedforward.
        model: the controller's model. Its `frequency_factor` scales omega_r.
        reference: the reference of the loop.
        override: a torque feedforward that replaces the controller's own and a learned one.

    Raises:
        InputError: if the gains overflow or underflow.
    """
    choice, motion = scenario.controller, reference.tracked
    i_eff = effective_inertia(model, torques_along(model, motion).d_kk)
    omega_r = None if choice.omega_r is None else choice.omega_r * model.frequency_factor
    if choice.kp is not None and choice.ki is not None:
        gains = SpeedGains(kp=np.array(choice.kp), ki=np.array(choice.ki))
    else:
        zeta = 1.0 if choice.zeta is None else choice.zeta
        gains = tune(i_eff.max(axis=0), omega_r or 0.0, zeta, choice.omega_ratio)
    position_gain = natural_frequency(gains, i_eff.max(axis=0)) / 4
    if choice.position_gain is not None:
        position_gain = np.array(choice.position_gain)
    feedforward = override or _own_feedforward(scenario, model, reference)
    return Tuning(model, motion, i_eff, omega_r, gains, position_gain, feedforward)


def _own_feedforward(scenario: Scenario, model: Robot, reference: Reference) -> Feedforward:
    """Return the feedforward of a scenario's controller, with a learned torque added."""
    choice, learned, motion = scenario.controller, reference.torque, reference.tracked
    kind = choice.feedforward_in_use
    if kind == "none" and not choice.friction_compensation:
        return Feedforward(learned)
    friction = None
    if choice.friction_compensation:
        friction = friction_parameters(scenario.plant.friction, model.n)
    gain = 1.0 if choice.feedforward_gain is None else np.array(choice.feedforward_gain)
    law = FeedforwardLaw(kind, gain, model, scenario.algorithm, friction)
    along = law.along(motion)
    if learned is not None:
        along = learned + along
    return Feedforward(along, law.along(steady(motion))[0], law)
