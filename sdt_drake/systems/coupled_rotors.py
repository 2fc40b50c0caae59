from typing import Any
from weakref import proxy

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.math import inv
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from sdt_drake.io.arrays import Array


# Drake's actuators have reflected inertias on the diagonal of the mass matrix alone, so this is a
# block in Python, where robots have coupled motors. AutoDiffXd is for linear models.
@TemplateSystem.define("CoupledRotors_", T_list=[float, AutoDiffXd])  # type: ignore[untyped-decorator]
def CoupledRotors_(T: type) -> type:  # noqa: N802 (a template of Drake)
    """Make the class of the block for a scalar type of Drake; None stands for float."""

    class Impl(LeafSystem_[T]):  # type: ignore[misc]
        """Torque of rotors that turn with two joints, joint side [N m].

            rotors = -S vd,    (M + S) vd = force - bias

        S is their part of the mass matrix off its diagonal, M the plant's. The plant, with force
        and rotors applied, then accelerates by vd. No state.

        Args:
            plant: Drake's plant of the robot.
            shared_inertia: S [kg m²], shape (n, n).

        .. pydrake_system::

            name: CoupledRotors
            input_ports: [state, force]
            output_ports: [rotors]
        """

        __slots__ = tuple[str, ...]()  # pydrake never frees a system with a second __dict__

        def _construct(
            self, plant: MultibodyPlant, shared_inertia: Array, converter: Any = None
        ) -> None:
            LeafSystem_[T].__init__(self, converter)
            self.made_of = plant, shared_inertia
            self._plant: Any = plant if T is float else plant.ToAutoDiffXd()
            self._context, n = self._plant.CreateDefaultContext(), plant.num_velocities()
            self._damping = np.zeros(n)
            for index in plant.GetJointIndices():
                joint = plant.get_joint(index)
                if joint.num_velocities():
                    self._damping[joint.velocity_start()] = joint.default_damping_vector()[0]
            self._state = self.DeclareVectorInputPort("state", 2 * n)
            self._applied = self.DeclareVectorInputPort("force", n)
            inputs = {self._state.ticket(), self._applied.ticket()}
            block = proxy(self)  # Drake keeps functions forever that refer to their own system

            def calc(context: Any, output: Any) -> None:
                block._calc(context, output)

            self.DeclareVectorOutputPort("rotors", n, calc, prerequisites_of_calc=inputs)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            plant, shared_inertia = other.made_of
            Impl._construct(self, plant, shared_inertia, converter)

        def _calc(self, context: Any, output: Any) -> None:
            plant, own, (_, shared) = self._plant, self._context, self.made_of
            state = self._state.Eval(context)
            plant.SetPositionsAndVelocities(own, state)
            force = self._applied.Eval(context) + plant.CalcGravityGeneralizedForces(own)
            force = force - plant.CalcBiasTerm(own) - self._damping * state[len(shared) :]
            M = plant.CalcMassMatrix(own) + shared
            vd = np.linalg.solve(M, force) if T is float else inv(M) @ force
            output.SetFromVector(-shared @ vd)

    return Impl
