"""What a URDF says is read as Drake reads it; what it cannot say is refused."""

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from robots import URDF, loaded


def dynamics(plant, q):
    """Mass matrix and gravity torques, joint side."""
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    return plant.CalcMassMatrix(context), plant.CalcGravityGeneralizedForces(context)


def test_places_and_turned_inertias_are_those_of_drakes_own_reader():
    text = URDF
    for old, new in (
        ('<origin xyz="0.8 0 0"/>', '<origin xyz="0.8 0.1 -0.2" rpy="0.3 -0.5 1.1"/>'),
        ('<origin xyz="0.5 0 0" rpy="0 0 0"/>', '<origin xyz="0.5 0.1 0" rpy="0.4 -0.3 0.9"/>'),
        ('ixy="0" ixz="0" iyz="0"', 'ixy="0.02" ixz="-0.01" iyz="0.03"'),
        ('<link name="lower">', '<link name="world"/><link name="lower">'),
        ('<link name="base"/>', ""),
        ('link="base"', 'link="world"'),
        ('<axis xyz="0 1 0"/>\n    <limit effort="40"/>', '<limit effort="40"/>'),  # along x
    ):
        assert old in text
        text = text.replace(old, new)
    robot, plant = loaded(text, ".urdf"), MultibodyPlant(0.0)
    still = text.replace('inertia value="0.01"', 'inertia value="0"')
    Parser(plant).AddModelsFromString(still, "urdf")
    plant.Finalize()
    for q in np.random.default_rng(1).uniform(-3, 3, (5, 2)):
        (M, gravity), (M_drake, gravity_drake) = dynamics(robot.plant, q), dynamics(plant, q)
        np.testing.assert_allclose(M - np.diag(robot.reflected_inertia), M_drake, rtol=1e-10)
        np.testing.assert_allclose(gravity, gravity_drake, rtol=1e-12, atol=1e-12)


_SHOULDER, _ELBOW = "joint 'shoulder'.*", "joint 'elbow'.*"
