import logging

import numpy as np
from pydrake.geometry import Meshcat, MeshcatVisualizer, MeshcatVisualizerParams, SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.rendering import MultibodyPositionToGeometryPose

from sdt_drake.io.resources import models_dir
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.shapes import drawable
from sdt_drake.systems.skeleton import skeleton
from sdt_drake.systems.wiring import build


def robot_drawing(*, robot: Robot, meshcat: Meshcat, period: float = 1 / 32) -> Diagram:
    """Make a drawing of a robot in Meshcat, below the path "/robot".

    Shapes are those of the robot's **file**; changes in memory are not drawn. Meshes that cannot be
    drawn are left out and logged. A robot without shapes gets a drum and an arrow along the axis
    of each joint, and rods to the next joint or the last centre of mass. Axes that meet get rings,
    as in a gimbal. The nested system "scene_graph" has the shapes.

    .. pydrake_system::

        name: robot_drawing
        input_ports: [state]

    Args:
        robot: drawn robot.
        meshcat: Meshcat server.
        period: publish period [s].
    """
    builder = DiagramBuilder()
    add_robot_drawing(builder, robot=robot, meshcat=meshcat, period=period)
    return build(builder, "robot_drawing")


def add_robot_drawing(
    builder: DiagramBuilder, *, robot: Robot, meshcat: Meshcat, period: float = 1 / 32
) -> tuple[MultibodyPlant, SceneGraph, bool]:
    """Add the parts of a `robot_drawing` to a builder.

    Returns:
        Plant with the drawn shapes, its scene graph, and True if the file has shapes on a moving
        link.
    """
    scene_graph = SceneGraph()
    builder.AddNamedSystem("scene_graph", scene_graph)
    plant = MultibodyPlant(0.0)
    source = plant.RegisterAsSourceForSceneGraph(scene_graph)
    parser = Parser(plant)
    parser.package_map().AddPackageXml(models_dir() / "package.xml")
    text, left_out = drawable(robot)
    if left_out:
        logging.getLogger(__name__).warning(f"{robot.path}: not drawn: {'; '.join(left_out)}")
    parser.AddModelsFromString(text, robot.path.suffix.lower().removeprefix("."))
    for index in robot.plant.GetJointIndices():
        joint = robot.plant.get_joint(index)
        if not plant.HasJointNamed(joint.name()):  # the root link of a URDF
            base = plant.GetFrameByName(joint.child_body().name())
            plant.WeldFrames(plant.world_frame(), base)
    if not (own := _has_shapes(robot, plant, scene_graph)):
        for part in skeleton(robot):
            body = plant.GetBodyByName(part.link) if part.link else plant.world_body()
            plant.RegisterVisualGeometry(
                body, part.pose, part.shape, part.name, np.array(part.colour)
            )
    plant.Finalize()
    poses = builder.AddNamedSystem(
        "poses", MultibodyPositionToGeometryPose(plant, input_multibody_state=True)
    )
    builder.Connect(poses.get_output_port(), scene_graph.get_source_pose_port(source))
    builder.ExportInput(poses.get_input_port(), "state")
    parameters = MeshcatVisualizerParams()
    parameters.prefix, parameters.publish_period = "/robot", period
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, parameters)
    return plant, scene_graph, own


def _has_shapes(robot: Robot, plant: MultibodyPlant, scene_graph: SceneGraph) -> bool:
    """Return True if the file has shapes on a moving link."""
    inspector = scene_graph.model_inspector()
    bodies = [plant.GetJointByName(name).child_body() for name in robot.joint_names]
    shapes = [shape for body in bodies for shape in plant.GetVisualGeometriesForBody(body)]
    return any(inspector.GetObbInGeometryFrame(shape) for shape in shapes)  # a plane has none
