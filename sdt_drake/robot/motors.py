"""The catalogue of motors, and a device with chosen motors, gears and structure."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from math import inf, pi
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, suggestion, within
from sdt_drake.io.fields import (
    EachJoint,
    EachJointOrNone,
    FileOf,
    Input,
    NonEmpty,
    NotNegative,
    Number,
    Positive,
    Problems,
    Text,
    field,
)
from sdt_drake.io.yaml_files import load_yaml
from sdt_drake.robot.brakes import Brake
from sdt_drake.robot.device import Drive
from sdt_drake.robot.envelope import Envelope
from sdt_drake.robot.parsed import parts_of
from sdt_drake.robot.robot import Robot, edited
from sdt_drake.robot.sdf import DRAKE, child, link_named, links_by_name, scale_link, set_inertia

DEFAULT_CATALOGUE = "package://sdt/motors.yaml"

_RPM = 2 * pi / 60  # rad/s


@dataclass(frozen=True, kw_only=True)
class Motor(Input):
    """A motor with its gearbox, if any; **motor side**."""

    id: Text
    """Short name."""
    kind: Literal["torque motor", "geared motor"]
    """Direct drive, or motor with gearbox."""
    peak_torque: Positive = field(unit="N m", side="motor")
    """Largest torque."""
    rated_torque: Positive = field(unit="N m", side="motor")
    """Continuous torque (S1) at a standstill or low speed."""
    rotor_inertia: Positive = field(unit="kg m²", side="motor")
    """Inertia of motor and gearbox."""
    n1_rpm: Positive | None = field(None, unit="rpm", side="motor")
    """Largest speed with peak torque. Unlimited by default."""
    n0_rpm: Positive | None = field(None, unit="rpm", side="motor")
    """Speed without driving torque; the torque falls linearly from n1_rpm to n0_rpm. Unlimited by
    default."""
    mass: Positive = field(unit="kg")
    """Mass of motor and gearbox."""
    gear_ratio: Positive = field(1.0, unit="-")
    """Motor speed over joint speed, unless the device chooses another ratio."""
    thermal_time_constant: Positive = field(unit="s")
    """Thermal time constant of the winding."""
    winding_rise: Positive = field(105.0, unit="K")
    """Temperature rise of the winding above its coolant at constant rated torque. Default: class F
    of IEC 60034-1 (resistance method)."""
    winding_limit: Number = field(155.0, le=300, unit="°C")
    """Largest temperature of the winding. Default: class F of IEC 60085."""
    housing_share: Number = field(0.0, ge=0, lt=1, unit="-")
    """Share of that rise that the housing has, which warms up more slowly."""
    housing_time_constant: Positive | None = field(None, unit="s")
    """Thermal time constant of the housing; required with a `housing_share`."""
    brake: Brake | None = field(None)
    """Brake on the motor's shaft; none by default. Only emergency stops use it."""
    source: Text
    """Origin of the numbers."""

    @property
    def n1(self) -> float:
        """`n1_rpm` in rad/s; inf if unlimited."""
        return inf if self.n1_rpm is None else self.n1_rpm * _RPM

    @property
    def n0(self) -> float:
        """`n0_rpm` in rad/s; inf if unlimited."""
        return inf if self.n0_rpm is None else self.n0_rpm * _RPM

    def problems(self) -> Problems:
        if self.rated_torque > self.peak_torque:
            yield (
                "rated_torque",
                f"{self.rated_torque:g}, expected at most peak_torque, {self.peak_torque:g}",
            )
        if self.n1_rpm is None or self.n0_rpm is None:
            if self.n1_rpm is not self.n0_rpm:
                missing = "n1_rpm" if self.n1_rpm is None else "n0_rpm"
                yield missing, "missing, expected n1_rpm and n0_rpm or neither"
        elif self.n0_rpm <= self.n1_rpm:
            yield "n0_rpm", f"{self.n0_rpm:g}, expected more than n1_rpm, {self.n1_rpm:g}"
        if self.housing_share and self.housing_time_constant is None:
            yield "housing_time_constant", "missing, required with a housing_share"
        if not self.takes_gear(self.gear_ratio):
            yield "gear_ratio", f"{self.gear_ratio:g}, but a torque motor drives directly: 1"

    def takes_gear(self, gear_ratio: float) -> bool:
        """Check whether the motor can have this gear ratio. A torque motor drives directly."""
        return self.kind != "torque motor" or gear_ratio == 1


@dataclass(frozen=True, kw_only=True)
class Catalogue(Input):
    """A catalogue of motors."""

    notes: str = ""
    """Notes for readers."""
    motors: NonEmpty[Motor]
    """The motors, in any order."""

    @property
    def ids(self) -> list[str]:
        """Ids of all motors in the catalogue."""
        return [motor.id for motor in self.motors]

    def motor(self, id_: str, where: str) -> Motor:
        """Return the motor of this id.

        Raises:
            InputError: an unknown id, at the place `where`; the message has similar ids.
        """
        for motor in self.motors:
            if motor.id == id_:
                return motor
        raise InputError(
            f"no motor '{id_}' in the catalogue, {suggestion(id_, self.ids)}", place=where
        )

    def problems(self) -> Problems:
        for i, id_ in enumerate(self.ids):
            if id_ in self.ids[:i]:
                yield f"motors[{i + 1}].id", f"'{id_}' is given twice"


def load_catalogue(path: str | Path = DEFAULT_CATALOGUE) -> Catalogue:
    """Read a catalogue of motors from YAML; by default the shipped one.

    >>> load_catalogue().motor("TM-2150", "example").peak_torque
    2150.0

    Raises:
        InputError: one line for each problem: file, field, value, and what is accepted.
    """
    return load_yaml(Catalogue, path, "motors")[0]


# --- the chosen device -----------------------------------------------------------------------


@dataclass(frozen=True)
class DeviceChoice(Input):
    """Motors, gears and structure of the device that differ from the robot file.

    Planner, controller and plant use this device. Lists have one value for each joint. Kinematics,
    damping, and the limits of position, speed and acceleration stay as in the file. The
    torque-speed envelope is that of the chosen motors, or of the kept motors in `fitted`, unless
    `drive` of the scenario has n1 and n0. Springs of `plant.elasticity` keep their frequencies.
    """

    motors: EachJointOrNone[str] = field(())
    """Ids of motors in the catalogue; "" keeps the motor of the robot file. All are kept by
    default."""
    gear_ratio: EachJoint[Positive] | None = field(None, unit="-")
    """Motor speed over joint speed. Default: that of the chosen motor, or of the robot file if the
    motor is kept."""
    structure_scale: Positive = field(1.0, unit="-")
    """s, factor on masses and inertias of all links except the payload: the thickness of their
    walls."""
    payload: str = "payload"
    """Name of the link that does not belong to the structure; "" if all links do."""
    stiffness_exponent: NotNegative = field(1.0, unit="-")
    """p: the stiffness of the structure changes by s^p. 1: walls of the same outline (assumed)."""
    fitted: EachJointOrNone[str] = field(())
    """Ids of the motors whose mass the robot file already includes; "" for none."""
    catalogue: Annotated[Text, FileOf("motors")] = DEFAULT_CATALOGUE
    """File of the motors, relative to the scenario's folder, or the name of a shipped file."""

    def problems(self) -> Problems:
        if any(self.motors) and not self.fitted:
            yield (
                "fitted",
                "missing; for each joint, name the motor whose mass the robot file already "
                "includes, '' if none",
            )


def chosen_robot(robot: Robot, choice: DeviceChoice) -> Robot:
    """Return the device with chosen motors, gears and structure; `robot` if nothing changes.

    A motor is a point mass on the link that carries its joint, at the origin of the joint's axis.
    Motors do not belong to the structure and do not scale. A link of mass M with the motor m_f gets
    the mass s (M - m_f) + m with the motor m.

    The lowest natural frequency of the structure changes by `frequency_factor`:

        omega_r = omega_r0 sqrt(s^p J_0 / J)

    J is the links' inertia about the first joint at q = 0, with payload and motors (assumed).

    >>> from sdt_drake.robot.robot import load_robot
    >>> chosen_robot(load_robot(), DeviceChoice(gear_ratio=[50, 1, 1, 1])).gear_ratio
    array([50.,  1.,  1.,  1.])

    Args:
        robot: the robot of the file.
        choice: the differences from the file.

    Raises:
        InputError: an unknown motor, or a device that is physically impossible.
    """
    if choice == DeviceChoice():
        return robot
    motors, fitted = _motors(choice, robot.n)  # report unknown motors even if unused
    envelope = _envelope(motors, fitted)
    if not any(motors) and choice.gear_ratio is None and choice.structure_scale == 1:
        return robot if envelope is None else replace(robot, envelope=envelope)
    with within(place="device"):
        other = edited(robot, lambda root: _fit(root, robot, choice, motors))
        other = _with_stators(other, motors, fitted, choice.structure_scale)
    stiffness = choice.structure_scale**choice.stiffness_exponent
    factor = np.sqrt(stiffness * _first_inertia(robot) / _first_inertia(other))
    factor = float(robot.frequency_factor * factor)
    return replace(other, frequency_factor=factor, envelope=envelope)


def as_driven(robot: Robot, drive: Drive) -> Robot:
    """Return the robot with the envelope of its drive; without one, that of its motors."""
    if drive.n1 is None or drive.n0 is None:
        return robot
    n1, n0 = (np.array(speeds, dtype=float) for speeds in (drive.n1, drive.n0))
    motors = "" if robot.envelope is None else f", instead of {robot.envelope.source}"
    return replace(robot, envelope=Envelope(n1, n0, f"drive.n1 and drive.n0{motors}"))


def motors_in_use(choice: DeviceChoice, n: int) -> list[Motor]:
    """Return the motor of each joint: the chosen one, or the fitted one if it is kept.

    Raises:
        InputError: an unknown motor, or a joint without a motor.
    """
    in_use = [motor or old for motor, old in zip(*_motors(choice, n), strict=True)]
    for k, motor in enumerate(in_use):
        if motor is None:
            raise InputError(
                f"joint {k + 1} has no motor of the catalogue, expected one", place="device"
            )
    return [motor for motor in in_use if motor is not None]


def _envelope(chosen: list[Motor | None], fitted: list[Motor | None]) -> Envelope | None:
    """Return the envelope of the motors; None if no joint has a motor of the catalogue."""
    motors = [motor or old for motor, old in zip(chosen, fitted, strict=True)]
    if not any(motors):
        return None
    n1, n0 = (np.array([getattr(m, name) if m else inf for m in motors]) for name in ("n1", "n0"))
    source = f"the motors of the catalogue ({', '.join(m.id if m else '-' for m in motors)})"
    without = [str(k + 1) for k in np.flatnonzero(np.isinf(n0))]
    if without:
        source += f"; without any: joint {', '.join(without)}, no n1_rpm and n0_rpm"
    return Envelope(n1, n0, source)


def _motors(choice: DeviceChoice, n: int) -> tuple[list[Motor | None], list[Motor | None]]:
    """Return the chosen and the fitted motor of each joint; None without an id."""
    catalogue = load_catalogue(choice.catalogue)

    def found(name: str) -> list[Motor | None]:
        return [
            catalogue.motor(id_, f"device.{name}[{k + 1}]") if id_ else None
            for k, id_ in enumerate(getattr(choice, name) or [""] * n)
        ]

    return found("motors"), found("fitted")


def _fit(root: ET.Element, robot: Robot, choice: DeviceChoice, motors: list[Motor | None]) -> None:
    """Apply motors, gears and the scale of the structure to an SDF, in place."""
    joints = {joint.get("name"): joint for joint in root.iter("joint")}
    for k, (name, motor) in enumerate(zip(robot.joint_names, motors, strict=True)):
        ratio = motor.gear_ratio if motor else robot.gear_ratio[k]
        if choice.gear_ratio is not None:
            ratio = choice.gear_ratio[k]
        elif motor is None:
            continue
        if motor and not motor.takes_gear(ratio):
            raise InputError(
                f"{ratio:g}, but {motor.id} drives directly, expected 1",
                place=f"gear_ratio[{k + 1}]",
            )
        peak = motor.peak_torque if motor else robot.motor_torque_limit[k]
        inertia = motor.rotor_inertia if motor else robot.rotor_inertia[k]
        _set(child(child(joints[name], "axis"), "limit"), "effort", peak * ratio)
        _set(joints[name], f"{DRAKE}rotor_inertia", inertia)
        _set(joints[name], f"{DRAKE}gear_ratio", ratio)
    if choice.structure_scale != 1:
        payload = link_named(root, choice.payload, "payload") if choice.payload else None
        for link in links_by_name(root).values():
            if link is not payload:
                scale_link(link, choice.structure_scale)


def _set(parent: ET.Element, tag: str, value: float) -> None:
    child(parent, tag).text = repr(float(value))


def _with_stators(
    robot: Robot, motors: list[Motor | None], fitted: list[Motor | None], s: float
) -> Robot:
    """Add the point mass m - s m_f, which may be negative, on the inboard side of each joint.

    A kept motor is the fitted one. Links that do not move stay as they are.
    """
    still = {body.index() for body in robot.plant.GetBodiesWeldedTo(robot.plant.world_body())}
    bodies = {}
    for name, motor, old in zip(robot.joint_names, motors, fitted, strict=True):
        m_f = old.mass if old else 0.0
        mass = (motor.mass if motor else m_f) - s * m_f
        frame = robot.plant.GetJointByName(name).frame_on_parent()
        link = frame.body().name()
        if mass != 0 and frame.body().index() not in still:
            place = frame.GetFixedPoseInBodyFrame().translation()
            bodies[link] = with_point_mass(*parts_of(frame.body()), mass, place)
            if bodies[link][0] <= 0:
                raise InputError(f"link '{link}' would be left with {bodies[link][0]:g} kg")

    def edit(root: ET.Element) -> None:
        for name, body in bodies.items():
            set_inertia(links_by_name(root)[name], *body)

    return edited(robot, edit) if bodies else robot


def with_point_mass(
    mass: float, com: Array, central: Array, added: float, place: Array
) -> tuple[float, Array, Array]:
    """Add a point mass to a body.

    With d from the body's centre to the point and mu = m m_p / (m + m_p), the inertia grows by
    mu (d² E - d d^T).

    Args:
        mass: mass of the body [kg].
        com: centre of mass of the body [m], shape (3,).
        central: inertia of the body about its centre [kg m²], shape (3, 3).
        added: mass of the point [kg]; a negative mass is removed.
        place: position of the point [m], shape (3,).

    Returns:
        Mass, centre of mass and central inertia of both together.
    """
    d, total = place - com, mass + added
    if total <= 0:
        return total, com, central
    reduced = mass * added / total
    return total, com + added / total * d, central + reduced * (d @ d * np.eye(3) - np.outer(d, d))


def _first_inertia(robot: Robot) -> float:
    """Return J, the links' inertia about the first joint at q = 0, joint side [kg m²]."""
    M = robot.plant.CalcMassMatrix(robot.context_at_zero())
    return M[0, 0] - robot.reflected_inertia[0]
