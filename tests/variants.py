"""Scenarios with other values in their fields."""

from __future__ import annotations

import copy
import functools
from dataclasses import replace

from sdt_drake.scenario import Scenario


def with_fields(scenario: Scenario, fields: dict) -> Scenario:
    """The scenario itself, its fields set by dotted name, unchecked."""
    for dotted, value in fields.items():
        *parts, field = dotted.split(".")
        setattr(functools.reduce(getattr, parts, scenario), field, copy.deepcopy(value))
    return scenario


def kind(label: str, **fields) -> dict:
    """Fields of a controller, "p_pi" or "p_pi+id" with its feedforward."""
    name, _, feedforward = label.partition("+")
    fields |= {"kind": name} | ({"feedforward": feedforward} if feedforward else {})
    return {f"controller.{field}": value for field, value in fields.items()}


def weaker(design, share):
    """With a share of its torque."""
    return replace(
        design, robot=replace(design.robot, effort_limit=share * design.robot.effort_limit)
    )
