"""Scenarios with other values in their fields."""

from __future__ import annotations

import copy
import functools

from sdt_drake.scenario import Scenario


def with_fields(scenario: Scenario, fields: dict) -> Scenario:
    """The scenario itself, its fields set by dotted name, unchecked."""
    for dotted, value in fields.items():
        *parts, field = dotted.split(".")
        setattr(functools.reduce(getattr, parts, scenario), field, copy.deepcopy(value))
    return scenario


def kind(name: str, **fields) -> dict:
    """Fields of a controller."""
    return {"controller.kind": name} | {f"controller.{f}": value for f, value in fields.items()}
