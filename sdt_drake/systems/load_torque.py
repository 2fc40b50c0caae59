"""Load torque of each motor: inverse dynamics and Algorithm 1. No state: a function of inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import (
    BasicVector,
    Context,
    Diagram,
    LeafSystem,
    ValueProducer,
)

from sdt_drake.dynamics import SIGNS, Loads, decouple, groups_of_sample
from sdt_drake.errors import checked_choice
from sdt_drake.motion import Motion
from sdt_drake.robot import Robot
from sdt_drake.systems.reference import make_held_table

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
        - q_ref
        - v_ref
        - vd_ref
        output_ports:
        - load_torque
        - alleviating_torque
    """

    def __init__(self, *, robot: Robot, sign: str = "consistent") -> None:
        """`sign` is that of Algorithm 1's third branch: "consistent" or "printed"."""
        super().__init__()
        self._robot = robot
        self._sign = checked_choice(sign, SIGNS, "sign of Algorithm 1")
        self._inputs = [
            self.DeclareVectorInputPort(name, robot.n) for name in ("q_ref", "v_ref", "vd_ref")
        ]
        # Without these, Drake takes every output to depend on time, and Python would be called
        # at every derivative evaluation.
        depends_on = {port.ticket() for port in self._inputs}
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
        q, v, vd = (port.Eval(context) for port in self._inputs)
        inertial, reaction, velocity, gravity, _ = groups_of_sample(
            self._robot, scratch.plant_context, q, v, vd
        )
        coupled = reaction + velocity + gravity
        scratch.loads = decouple(inertial, coupled, self._robot.gear_ratio, self._sign)

    def _calc_load_torque(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._loads.Eval(context).loads.load_torque)

    def _calc_alleviating_torque(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._loads.Eval(context).loads.alleviating_torque)


def make_load_torque_table(motion: Motion, loads: Loads) -> Diagram:
    """The same torques as `LoadTorque` gives along `motion`, from a table made beforehand.

    Each sample is in force from its own instant on, as with the reference. It needs no input, and
    no Python while the simulation runs; it knows nothing of any other motion.

    .. pydrake_system::

        name: load_torque_table
        output_ports:
        - load_torque
        - alleviating_torque
    """
    return make_held_table("load_torque_table", motion, loads._asdict())
