"""Robots from tables of Denavit and Hartenberg, as SDF: two of which recordings are published.

The recordings have licences of their own and are not part of the project. Tests that need them are
skipped unless a folder has them, `$SDT_RECORDINGS` or else `shared/data` beside the project:
ur10/exciting.csv (of github.com/unisa-acg/inverse-dynamics-solver; time, q_k, v_k, tau_k, joint
side) and kuka_kr300/recording_A.csv, recording_B.csv (of github.com/JonasWeigand/
Robot_Identification; time, q_ref_k, v_ref_k, vd_ref_k, q_motor_k, q_link_k, joint side,
motor_torque_k, motor_feedforward_k, motor side), in SI units.

Link k is turned and moved from link k - 1 by Rz(q + theta) Tz(d) Tx(a) Rx(alpha) (the standard
convention). Independent: poses, masses and centres are numbers of the makers' tables and go into
the SDF by this convention; recorded torques come from real robots. The frame of a link is that of
the table, in which centres of mass are published, and its joint turns about z of the link before.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

_BESIDE = Path(__file__).resolve().parents[3] / "shared" / "data"
DATA = Path(os.environ.get("SDT_RECORDINGS", _BESIDE))
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="$SDT_RECORDINGS: no such folder")

_LINK = """
    <link name="link_{k}">
      <pose relative_to="{frame}">{pose}</pose>
      <inertial>
        <pose>{com} 0 0 0</pose>
        <mass>{mass!r}</mass>
        <inertia><ixx>{inertia!r}</ixx><iyy>{inertia!r}</iyy><izz>{inertia!r}</izz></inertia>
      </inertial>
    </link>
    <joint name="joint_{k}" type="revolute">
      <pose>{joint_pose}</pose>
      <parent>{parent}</parent>
      <child>link_{k}</child>
      <axis>
        <xyz>0 0 1</xyz>
        <limit><effort>{effort!r}</effort><velocity>{speed!r}</velocity></limit>
      </axis>
      <drake:rotor_inertia>{rotor_inertia!r}</drake:rotor_inertia>
      <drake:gear_ratio>{gear_ratio!r}</drake:gear_ratio>
    </joint>"""


@dataclass(frozen=True)
class DhTable:
    """A robot; lists have one value for each joint.

    Attributes:
        name: of the model.
        d, a: [m].
        alpha, theta: [rad], theta where the joint stands at q = 0.
        mass: of the links [kg].
        com: their centres, in their frames [m].
        radius: of gyration of every link about its centre, the same about all axes [m] (assumed).
        speed: limits [rad/s].
        effort: limits, joint side [N m].
        rotor_inertia: motor side [kg m²].
        gear_ratio: [-].
        base: roll, pitch, yaw of the base [rad].
    """

    name: str
    d: list[float]
    a: list[float]
    alpha: list[float]
    theta: list[float]
    mass: list[float]
    com: list[tuple[float, float, float]]
    radius: float
    speed: list[float]
    effort: list[float]
    rotor_inertia: list[float]
    gear_ratio: list[float]
    base: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def moved(self, k: int) -> RigidTransform:
        """Link k, from 0, in the frame of the link before it, at q = 0."""
        turn = RigidTransform(RotationMatrix.MakeZRotation(self.theta[k]), np.zeros(3))
        tilt = RotationMatrix.MakeXRotation(self.alpha[k])
        return turn @ RigidTransform(tilt, [self.a[k], 0, self.d[k]])

    @property
    def sdf(self) -> str:
        """The robot as the text of an SDF."""
        links = ""
        for k, mass in enumerate(self.mass):
            base = RigidTransform(RollPitchYaw(self.base if k == 0 else np.zeros(3)), np.zeros(3))
            links += _LINK.format(
                k=k + 1,
                frame="__model__" if k == 0 else f"link_{k}",
                parent="world" if k == 0 else f"link_{k}",
                pose=_told(base @ self.moved(k)),
                joint_pose=_told(self.moved(k).inverse()),
                com=" ".join(map(repr, self.com[k])),
                mass=mass,
                inertia=mass * self.radius**2,
                effort=self.effort[k],
                speed=self.speed[k],
                rotor_inertia=self.rotor_inertia[k],
                gear_ratio=self.gear_ratio[k],
            )
        start = '<sdf version="1.9" xmlns:drake="http://drake.mit.edu">'
        return f'{start}\n  <model name="{self.name}">{links}\n  </model>\n</sdf>\n'

    def write(self, folder: Path) -> Path:
        """The SDF file, new in `folder`."""
        path = folder / f"{self.name}.sdf"
        path.write_text(self.sdf)
        return path


def _told(pose: RigidTransform) -> str:
    numbers = [*pose.translation(), *RollPitchYaw(pose.rotation()).vector()]
    return " ".join(repr(float(x)) for x in numbers)


_RIGHT = np.pi / 2

UR10 = DhTable(  # the maker's; the motors' inertia is in no table
    name="ur10",
    d=[0.1273, 0.0, 0.0, 0.163941, 0.1157, 0.0922],
    a=[0.0, -0.612, -0.5723, 0.0, 0.0, 0.0],
    alpha=[_RIGHT, 0.0, 0.0, _RIGHT, -_RIGHT, 0.0],
    theta=[0.0] * 6,
    mass=[7.1, 12.7, 4.27, 2.0, 2.0, 0.365],
    com=[
        (0.021, 0.0, 0.027),
        (0.38, 0.0, 0.158),
        (0.24, 0.0, 0.068),
        (0.0, 0.007, 0.018),
        (0.0, 0.007, 0.018),
        (0.0, 0.0, -0.026),
    ],
    radius=0.1,
    speed=[2.09, 2.09, 3.14, 3.14, 3.14, 3.14],
    effort=[330.0, 330.0, 150.0, 56.0, 56.0, 56.0],
    rotor_inertia=[0.0] * 6,
    gear_ratio=[1.0] * 6,
)

KUKA_KR300 = DhTable(  # of its recordings, as are its angles; centres of mass are assumed
    name="kuka_kr300",
    d=[-0.675, -0.189, 0.189, -1.0, 0.0, -0.24],
    a=[0.350, 1.15, 0.041, 0.0, 0.0, 0.0],
    alpha=[_RIGHT, 0.0, -_RIGHT, _RIGHT, -_RIGHT, np.pi],
    theta=[0.0, -_RIGHT, np.pi, 0.0, 0.0, 0.0],
    mass=[395.4, 339.1, 105.2, 35.8, 31.5, 200.0],
    com=[
        (-0.175, 0.0, 0.0),
        (-0.575, 0.0, 0.0),
        (0.0, 0.0, -0.2),
        (0.0, 0.4, 0.0),
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
    ],
    radius=0.2,
    speed=[2.0] * 6,
    effort=[15000.0, 15000.0, 12000.0, 5000.0, 5000.0, 4000.0],
    rotor_inertia=[0.00923, 0.0118, 0.0118, 0.00173, 0.00173, 0.00173],
    gear_ratio=[256.857, 267.429, 252.333, 221.0, 239.619, 154.323],
    base=(np.pi, 0.0, 0.0),
)
