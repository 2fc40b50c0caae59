"""Load torque of each motor: inverse dynamics and Algorithm 1. No state: a function of inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import BasicVector, Context, LeafSystem, ValueProducer

from sdt_drake.dynamics import SIGNS, Loads, decouple, groups_of_sample
from sdt_drake.errors import checked_choice
from sdt_drake.robot import Robot
from sdt_drake.systems.block import Block

Array = NDArray[np.float64]


@dataclass
class _Scratch:
    """What one context of the block works with: a context of the plant, and the result."""

    plant_context: Context
    loads: Loads


class LoadTorque(LeafSystem):
    """Load torque and alleviating torque of the reference, on line from the MultibodyPlant.

    tau_coupled of Eq. 4 from the held reference, split by Algorithm 1, motor side [N m]. It does
    not sample: with held inputs the cache evaluates it once per sample, without delay. It does not
    see the plant's state, nor the motors' inertia (link side, as the paper has it).

    .. pydrake_system::

        name: LoadTorque
        input_ports:
        - reference
        output_ports:
        - load_torque
        - alleviating_torque
    """

    def __init__(self, *, robot: Robot, sign: str = "consistent") -> None:
        """`sign` is that of Algorithm 1's third branch: "consistent" or "printed"."""
        super().__init__()
        self._robot = robot
        self._sign = checked_choice(sign, SIGNS, "sign of Algorithm 1")
        self._reference = self.DeclareVectorInputPort("reference", 3 * robot.n)
        # Without these, Drake takes every output to depend on time, and Python would be called
        # at every derivative evaluation.
        depends_on = {self._reference.ticket()}
        self._loads = self.DeclareCacheEntry(
            "loads", ValueProducer(self._allocate, self._calc_loads), depends_on
        )
        for name, calc in (
            ("load_torque", self._calc_load_torque),
            ("alleviating_torque", self._calc_alleviating_torque),
        ):
            self.DeclareVectorOutputPort(name, robot.n, calc, prerequisites_of_calc=depends_on)

    def _allocate(self) -> AbstractValue:
        nothing = np.zeros(self._robot.n)
        return AbstractValue.Make(
            _Scratch(self._robot.plant.CreateDefaultContext(), Loads(nothing, nothing))
        )

    def _calc_loads(self, context: Context, value: AbstractValue) -> None:
        scratch = value.get_mutable_value()
        reference = self._reference.Eval(context)
        end_of_v = 2 * self._robot.n
        inertial, reaction, velocity, gravity, _ = groups_of_sample(
            self._robot, scratch.plant_context, reference[:end_of_v], reference[end_of_v:]
        )
        coupled = reaction + velocity + gravity
        scratch.loads = decouple(inertial, coupled, self._robot.gear_ratio, self._sign)

    def _calc_load_torque(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._loads.Eval(context).loads.load_torque)

    def _calc_alleviating_torque(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._loads.Eval(context).loads.alleviating_torque)


def load_torque_block(block: Block, *, robot: Robot, sign: str) -> None:
    """`LoadTorque` as a block.

    .. pydrake_system::

        name: load_torque
        input_ports:
        - reference
        output_ports:
        - load_torque
        - alleviating_torque
    """
    system = block.add(LoadTorque(robot=robot, sign=sign))
    block.inputs["reference"] = system.GetInputPort("reference")
    for signal in Loads._fields:
        block.outputs[signal] = system.GetOutputPort(signal)
