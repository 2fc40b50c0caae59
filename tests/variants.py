"""Fields of scenarios, and designs, that tests vary."""

from __future__ import annotations

from dataclasses import replace


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
