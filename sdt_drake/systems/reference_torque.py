"""Torques of the reference, on line from the MultibodyPlant. No state: functions of the input."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import BasicVector, Context, LeafSystem, ValueProducer

from sdt_drake.control import FEEDFORWARDS, feedforward_torque
from sdt_drake.dynamics import SIGNS, Loads, decouple, groups_of_sample
from sdt_drake.errors import checked_choice
from sdt_drake.robot import Robot
from sdt_drake.systems.block import Block

Array = NDArray[np.float64]

Groups = tuple[Array, Array, Array, Array]
Law = Callable[[Groups, Array, Array], Sequence[Array]]
"""From the torque groups (inertial, reaction, velocity, gravity), v_ref and vd_ref to outputs."""


@dataclass
class _Scratch:
    """What one context of the block works with: a context of the plant, and the results."""

    plant_context: Context
    torques: Sequence[Array]


class ReferenceTorque(LeafSystem):
    """Torques that follow from the reference by inverse dynamics.

    It does not sample: with a held input the cache evaluates it once per sample, without delay. It
    does not see the plant's state.

    .. pydrake_system::

        name: ReferenceTorque
        input_ports:
        - reference
        output_ports:
        - (outputs)
    """

    def __init__(self, *, robot: Robot, outputs: Sequence[str], law: Law) -> None:
        """`law` gives one array of shape (n,) for each of `outputs`."""
        super().__init__()
        self._robot = robot
        self._law = law
        self._nothing = [np.zeros(robot.n)] * len(outputs)
        self._reference = self.DeclareVectorInputPort("reference", 3 * robot.n)
        # Without these, Drake takes every output to depend on time, and Python would be called
        # at every derivative evaluation.
        depends_on = {self._reference.ticket()}
        self._torques = self.DeclareCacheEntry(
            "torques", ValueProducer(self._allocate, self._calc_torques), depends_on
        )
        for i, name in enumerate(outputs):
            self.DeclareVectorOutputPort(
                name,
                robot.n,
                lambda context, output, i=i: self._calc_output(context, output, i),
                prerequisites_of_calc=depends_on,
            )

    def _allocate(self) -> AbstractValue:
        return AbstractValue.Make(_Scratch(self._robot.plant.CreateDefaultContext(), self._nothing))

    def _calc_torques(self, context: Context, value: AbstractValue) -> None:
        scratch = value.get_mutable_value()
        reference, end_of_v = self._reference.Eval(context), 2 * self._robot.n
        q_and_v, vd = reference[:end_of_v], reference[end_of_v:]
        groups = groups_of_sample(self._robot, scratch.plant_context, q_and_v, vd)[:4]
        scratch.torques = self._law(groups, q_and_v[self._robot.n :], vd)

    def _calc_output(self, context: Context, output: BasicVector, i: int) -> None:
        output.SetFromVector(self._torques.Eval(context).torques[i])


def load_torque_block(block: Block, *, robot: Robot, sign: str) -> None:
    """Load torque and alleviating torque of the reference, on line.

    tau_coupled of Eq. 4 from the held reference, split by Algorithm 1, motor side [N m]. It does
    not see the motors' inertia (link side, as the paper has it).

    .. pydrake_system::

        name: load_torque
        input_ports:
        - reference
        output_ports:
        - load_torque
        - alleviating_torque

    Raises:
        InputError: for another `sign` of Algorithm 1's third branch than "consistent", "printed".
    """
    checked_choice(sign, SIGNS, "sign of Algorithm 1")

    def law(groups: Groups, _v: Array, _vd: Array) -> Loads:
        inertial, reaction, velocity, gravity = groups
        return decouple(inertial, reaction + velocity + gravity, robot.gear_ratio, sign)

    _place(block, robot, Loads._fields, law)


def feedforward_torque_block(
    block: Block,
    *,
    model: Robot,
    feedforward: str,
    sign: str,
    gain: Array,
    friction: Callable[[Array], Array],
) -> None:
    """Torque feedforward of the reference, on line from the controller's model.

        tau_ff = gain feedforward_torque + friction(v_ref) / r        [N m], motor side

    .. pydrake_system::

        name: feedforward_torque
        input_ports:
        - reference
        output_ports:
        - tau_ff

    Args:
        model: what the controller takes the robot for.
        feedforward: "none", "ctc" or "id", see `sdt_drake.control.feedforward_torque`.
        sign: of Algorithm 1's third branch.
        gain: [-], shape (n,).
        friction: joint side [N m], of the speeds [rad/s].

    Raises:
        InputError: for another feedforward or sign.
    """
    checked_choice(feedforward, FEEDFORWARDS, "feedforward")
    checked_choice(sign, SIGNS, "sign of Algorithm 1")

    def law(groups: Groups, v: Array, vd: Array) -> Sequence[Array]:
        torque = feedforward_torque(feedforward, model, groups, vd, sign)
        return [gain * torque + friction(v) / model.gear_ratio]

    _place(block, model, ("tau_ff",), law)


def _place(block: Block, robot: Robot, outputs: Sequence[str], law: Law) -> None:
    system = block.add(ReferenceTorque(robot=robot, outputs=outputs, law=law))
    block.inputs["reference"] = system.GetInputPort("reference")
    for signal in outputs:
        block.outputs[signal] = system.GetOutputPort(signal)
