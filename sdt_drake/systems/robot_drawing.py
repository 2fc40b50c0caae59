from __future__ import annotations

from itertools import pairwise

import numpy as np
from pydrake.geometry import (
    Cylinder,
    Meshcat,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.rendering import MultibodyPositionToGeometryPose

from sdt_drake.io.resources import models_dir
from sdt_drake.robot.robot import Robot

_ROD_RADIUS = 0.07  # m


class RobotDrawing(Diagram):
    """Draws a robot where it is in Meshcat, below the path "/robot", every `period` [s].

    As its **file** draws it; changes in memory are not seen. A robot without a single visual gets
    a ball at each joint and rods between them, the last to the centre of mass of the last link. It
    moves nothing.

    .. pydrake_system::

        name: RobotDrawing
        input_ports: [state]

    Attributes:
        plant, scene_graph: what is drawn, and by what.
    """

    def __init__(self, *, robot: Robot, meshcat: Meshcat, period: float = 1 / 32) -> None:
        super().__init__()
        builder = DiagramBuilder()
        self.plant, self.scene_graph = add_robot_drawing(
            builder, robot=robot, meshcat=meshcat, period=period
        )
        builder.BuildInto(self)


def add_robot_drawing(
    builder: DiagramBuilder, *, robot: Robot, meshcat: Meshcat, period: float = 1 / 32
) -> tuple[MultibodyPlant, SceneGraph]:
    """Add what a `RobotDrawing` is made of: for who draws in many a Meshcat, since pydrake frees no
    diagram of a Python class, nor the server that it draws in."""
    scene_graph = SceneGraph()
    builder.AddNamedSystem("scene_graph", scene_graph)
    plant = MultibodyPlant(0.0)
    source = plant.RegisterAsSourceForSceneGraph(scene_graph)
    parser = Parser(plant)
    parser.package_map().AddPackageXml(models_dir() / "package.xml")
    parser.AddModels(robot.path)
    for index in robot.plant.GetJointIndices():
        joint = robot.plant.get_joint(index)
        if not plant.HasJointNamed(joint.name()):  # the root link of a URDF
            base = plant.GetFrameByName(joint.child_body().name())
            plant.WeldFrames(plant.world_frame(), base)
    _draw_skeleton(robot, plant, scene_graph)
    plant.Finalize()
    poses = builder.AddNamedSystem(
        "poses", MultibodyPositionToGeometryPose(plant, input_multibody_state=True)
    )
    builder.Connect(poses.get_output_port(), scene_graph.get_source_pose_port(source))
    builder.ExportInput(poses.get_input_port(), "state")
    parameters = MeshcatVisualizerParams()
    parameters.prefix, parameters.publish_period = "/robot", period
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat, parameters)
    return plant, scene_graph


def _draw_skeleton(robot: Robot, plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
    joints = [plant.GetJointByName(name) for name in robot.joint_names]
    inspector = scene_graph.model_inspector()
    for joint in joints:
        shapes = plant.GetVisualGeometriesForBody(joint.child_body())
        if any(inspector.GetObbInGeometryFrame(shape) for shape in shapes):  # a plane has none
            return
    own = robot.plant.CreateDefaultContext()
    frames = [robot.plant.GetJointByName(name).frame_on_child() for name in robot.joint_names]
    ends = [b.CalcPose(own, a).translation() for a, b in pairwise(frames)]
    ends.append(frames[-1].GetFixedPoseInBodyFrame().inverse() @ frames[-1].body().default_com())
    blue, grey = np.array([0.2, 0.3, 0.5, 1.0]), np.array([0.5, 0.5, 0.5, 1.0])
    for k, joint in enumerate(joints):
        body, pose = joint.child_body(), joint.frame_on_child().GetFixedPoseInBodyFrame()
        ball = Sphere(2 * _ROD_RADIUS)
        plant.RegisterVisualGeometry(body, pose, ball, f"joint_{k}", blue)
        length = float(np.linalg.norm(ends[k]))
        if length > 0:
            along = RigidTransform(RotationMatrix.MakeFromOneVector(ends[k], 2), ends[k] / 2)
            rod = Cylinder(_ROD_RADIUS, length)
            plant.RegisterVisualGeometry(body, pose.multiply(along), rod, f"rod_{k}", grey)
