"""Torques of the reference, computed online from the MultibodyPlant. No state."""

from collections.abc import Callable, Sequence
from typing import Any, cast
from weakref import proxy

from pydrake.common.value import AbstractValue
from pydrake.systems.framework import BasicVector, Context, LeafSystem, ValueProducer

from sdt_drake.io.arguments import one_of
from sdt_drake.io.arrays import Array
from sdt_drake.robot.dynamics import SIGNS, Loads, decouple, groups_of_sample
from sdt_drake.robot.robot import Robot

TorqueLaw = Callable[[Sequence[Array], Array, Array], Sequence[Array]]
"""Function of torque groups (Eq. 2), v_ref and vd_ref, joint side; returns all outputs."""


class ReferenceTorque(LeafSystem):
    """Torques of the reference by inverse dynamics, combined by `law`.

    `law(groups, v_ref, vd_ref)` returns all outputs from the torque groups of Eq. 2, joint side.
    The block does not sample and does not depend on the plant's state. With a held input the cache
    evaluates it once per sample, without delay.

    .. pydrake_system::

        name: ReferenceTorque
        input_ports: [reference]
        output_ports: [(torques)]
    """

    __slots__ = ()  # pydrake never frees a system with a second __dict__

    def __init__(self, *, robot: Robot, outputs: Sequence[str], law: TorqueLaw) -> None:
        super().__init__()
        block: Any = proxy(self)  # Drake keeps functions forever that refer to their own system
        self._robot, self._law = robot, law
        self._reference = self.DeclareVectorInputPort("reference", 3 * robot.n)
        # Without prerequisites Drake assumes that outputs depend on time, and would call Python at
        # every evaluation of derivatives.
        depends_on = {self._reference.ticket()}

        def scratch() -> Any:
            """Make the cache of a context of the block: a context of the plant, and the torques."""
            return AbstractValue.Make([robot.plant.CreateDefaultContext(), ()])

        def calc(context: Context, value: AbstractValue) -> None:
            block._calc(context, value)

        producer = ValueProducer(scratch, cast(Any, calc))
        index = self.DeclareCacheEntry("torques", producer, depends_on).cache_index()

        def output(i: int) -> Callable[[Context, BasicVector], None]:
            def copy(context: Context, torque: BasicVector) -> None:
                torque.SetFromVector(block.get_cache_entry(index).Eval(context)[1][i])

            return copy

        for i, name in enumerate(outputs):
            self.DeclareVectorOutputPort(name, robot.n, output(i), prerequisites_of_calc=depends_on)

    def _calc(self, context: Context, value: AbstractValue) -> None:
        scratch, n = cast(Any, value).get_mutable_value(), self._robot.n
        reference = cast(Array, self._reference.Eval(context))
        q_and_v, vd = reference[: 2 * n], reference[2 * n :]
        groups = groups_of_sample(self._robot, scratch[0], q_and_v, vd)[:4]
        scratch[1] = self._law(groups, q_and_v[n:], vd)


class LoadTorque(ReferenceTorque):
    """Load torque and alleviating torque of the reference (Eq. 4, Algorithm 1, Figure 3).

        load_torque, alleviating_torque = Algorithm 1 (tau_coupled, d_kk vd_ref) / r

    Both are motor side [N m], without rotor inertia (link side, as in the paper).

    Args:
        robot: robot or controller's model.
        algorithm: sign of Algorithm 1's third branch, one of SIGNS.

    .. pydrake_system::

        name: LoadTorque
        input_ports: [reference]
        output_ports: [load_torque, alleviating_torque]
    """

    __slots__ = ()

    def __init__(self, *, robot: Robot, algorithm: str = "consistent") -> None:
        one_of(algorithm, "algorithm", SIGNS)

        def law(groups: Sequence[Array], _v: Array, _vd: Array) -> Loads:
            inertial, reaction, velocity, gravity = groups
            return decouple(inertial, reaction + velocity + gravity, robot.gear_ratio, algorithm)

        super().__init__(robot=robot, outputs=Loads._fields, law=law)
