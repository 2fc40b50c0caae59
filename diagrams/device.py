"""The device as its SDF draws it.

    python diagrams/device.py [FOLDER]

Writes device.png into FOLDER, by default the folder of this script.
"""

import sys
from pathlib import Path

import matplotlib.image
import numpy as np
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from sdt_drake.resources import models_dir

EYE, TARGET = np.array([7.3, 4.0, 3.0]), np.array([1.3, -0.2, -0.55])  # m
POSE = [0.0, 0.3, -0.15, 0.3]  # rad
LIGHTS = [([-0.5, -0.4, -0.8], 0.85), ([-0.9, 0.3, -0.2], 0.4), ([0.4, -0.8, -0.2], 0.35)]
BACKGROUND = [0.96, 0.97, 0.98]  # RGB


def main(folder: Path) -> None:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    Parser(plant).AddModels(str(models_dir() / "sdt.sdf"))
    plant.Finalize()
    lights = [
        LightParameter(type="directional", direction=direction, frame="world", intensity=intensity)
        for direction, intensity in LIGHTS
    ]
    parameters = RenderEngineVtkParams(default_clear_color=BACKGROUND, lights=lights)
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(parameters))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), POSE)

    core = RenderCameraCore(
        "vtk", CameraInfo(1200, 640, np.radians(34)), ClippingRange(0.1, 50), RigidTransform()
    )
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    image = query.RenderColorImage(
        ColorRenderCamera(core), scene_graph.world_frame_id(), looking(EYE, TARGET)
    )
    folder.mkdir(parents=True, exist_ok=True)
    matplotlib.image.imsave(folder / "device.png", image.data[:, :, :3])


def looking(eye: np.ndarray, target: np.ndarray) -> RigidTransform:
    """Pose of a camera at `eye` that looks at `target`: z forward, y down."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    return RigidTransform(RotationMatrix(np.stack([x, np.cross(z, x), z], axis=1)), eye)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
