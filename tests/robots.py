"""Robots of tests as texts: a planar arm with round numbers, and random chains."""

import atexit
import functools
import hashlib
import tempfile
from pathlib import Path

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.robot.robot import Robot, load_robot

# A planar arm: both joints turn about y; at q = 0 it points along x. Link 1 is 0.8 m long, its
# centre of mass is at 0.5 m; that of link 2 is 0.3 m from the elbow.
ARM = """<?xml version="1.0"?>
<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <model name="arm">
    <link name="upper">
      <inertial>
        <pose>0.5 0 0 0 0 0</pose><mass>4</mass>
        <inertia><ixx>0.25</ixx><iyy>0.5</iyy><izz>0.6</izz></inertia>
      </inertial>
    </link>
    <link name="lower">
      <pose relative_to="elbow"/>
      <inertial>
        <pose>0.3 0 0 0 0 0</pose><mass>2</mass>
        <inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.25</izz></inertia>
      </inertial>
    </link>
    <joint name="shoulder" type="revolute">
      <parent>world</parent><child>upper</child>
      <axis>
        <xyz>0 1 0</xyz>
        <limit><effort>90</effort><velocity>3</velocity><lower>-2</lower><upper>1</upper></limit>
        <dynamics><damping>0.7</damping></dynamics>
      </axis>
      <drake:rotor_inertia>0.01</drake:rotor_inertia><drake:gear_ratio>10</drake:gear_ratio>
    </joint>
    <joint name="elbow" type="revolute">
      <pose relative_to="upper">0.8 0 0 0 0 0</pose><parent>upper</parent><child>lower</child>
      <axis><xyz>0 1 0</xyz><limit><effort>40</effort></limit></axis>
    </joint>
  </model>
</sdf>
"""

URDF = """<?xml version="1.0"?>
<robot name="arm" xmlns:drake="http://drake.mit.edu">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base"/>
  <link name="upper"><inertial>
    <origin xyz="0.5 0 0" rpy="0 0 0"/><mass value="4"/>
    <inertia ixx="0.25" iyy="0.5" izz="0.6" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
  <link name="lower"><inertial>
    <origin xyz="0.3 0 0"/><mass value="2"/><inertia ixx="0.1" iyy="0.2" izz="0.25"/>
  </inertial></link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit effort="90" velocity="3" lower="-2" upper="1"/><dynamics damping="0.7"/>
    <safety_controller k_velocity="9"/>
  </joint>
  <joint name="elbow" type="continuous">
    <origin xyz="0.8 0 0"/><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/>
    <limit effort="40"/>
  </joint>
  <transmission name="drive">
    <robotNamespace>/arm</robotNamespace>
    <type>transmission_interface/SimpleTransmission</type>
    <joint name="shoulder"><hardwareInterface>effort</hardwareInterface></joint>
    <actuator name="motor">
      <drake:rotor_inertia value="0.01"/><mechanicalReduction>10</mechanicalReduction>
    </actuator>
  </transmission>
  <gazebo reference="upper"><mu1>0.2</mu1></gazebo>
</robot>
"""
"""The same arm."""


def chain_names(n: int) -> tuple[str, ...]:
    """Joints of `chain_sdf`, base to tip: the alphabet would have them the other way round."""
    return tuple(f"joint_{chr(ord('z') - k)}" for k in range(n))


def chain_sdf(
    n: int,
    *,
    seed: int = 0,
    base: bool = False,
    rotor_inertia: float = 0.01,
    motors: dict[str, np.ndarray] | None = None,
    extra: str = "",
) -> str:
    """A random chain of n joints, declared in no order, with products of inertia and damping.

    Joint k = 1..n has effort 100 k, rotor inertia k `rotor_inertia`, gear ratio 2 and damping
    0.1 k, unless `motors` has them, each of shape (n,). With `base`, the first joint stands on a
    link that is welded to the world. `extra`: more elements of the model.
    """
    rng, k = np.random.default_rng(seed), np.arange(1, n + 1)
    given = {"effort": 100.0 * k, "rotor_inertia": k * rotor_inertia, "gear_ratio": 0.0 * k + 2}
    given |= {"damping": 0.1 * k} | (motors or {})
    parts = []
    for i, name in enumerate(chain_names(n)):
        parent = f"link_{i}" if i else "base" if base else "world"
        effort, rotor, ratio, damping = (float(x[i]) for x in given.values())
        # Four masses of 1.5 kg: an inertia that a body can have.
        r = rng.normal(scale=0.3, size=(4, 3))
        com = r.mean(axis=0)
        r -= com
        inertia = 1.5 * (np.sum(r**2) * np.eye(3) - r.T @ r)
        moments = "".join(
            f"<i{'xyz'[a]}{'xyz'[b]}>{float(inertia[a, b])!r}</i{'xyz'[a]}{'xyz'[b]}>"
            for a, b in zip(*np.triu_indices(3), strict=True)
        )
        parts.append(
            f'<link name="link_{i + 1}"><pose relative_to="{name}"/><inertial><mass>6</mass>'
            f"<pose>{_text(com)} 0 0 0</pose><inertia>{moments}</inertia></inertial></link>"
        )
        parts.append(
            f'<joint name="{name}" type="revolute"><pose relative_to='
            f'"{"__model__" if parent == "world" else parent}">'
            f"{_text(rng.uniform(-0.5, 0.5, size=6))}</pose>"
            f"<parent>{parent}</parent><child>link_{i + 1}</child>"
            f"<axis><xyz>{_text(rng.normal(size=3))}</xyz><limit><effort>{effort!r}</effort></limit>"
            f"<dynamics><damping>{damping!r}</damping></dynamics></axis>"
            f"<drake:rotor_inertia>{rotor!r}</drake:rotor_inertia>"
            f"<drake:gear_ratio>{ratio!r}</drake:gear_ratio></joint>"
        )
    if base:
        parts.append(
            '<link name="base"><inertial><mass>9</mass><inertia><ixx>1</ixx><iyy>1</iyy>'
            "<izz>1</izz></inertia></inertial></link>"
        )
        parts.append(
            '<joint name="anchor" type="fixed"><parent>world</parent><child>base</child></joint>'
        )
    rng.shuffle(parts)
    return (
        '<sdf version="1.9" xmlns:drake="http://drake.mit.edu" xmlns:sdt="urn:sdt_drake">'
        f'<model name="chain">{"".join(parts)}{extra}</model></sdf>'
    )


def _text(values) -> str:
    return " ".join(map(repr, map(float, values)))


def loaded(text: str, suffix: str = ".sdf") -> Robot:
    """The robot of a text, in a file that stays until the tests end."""
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    path = _folder() / f"{name}{suffix}"
    path.write_text(text, encoding="utf-8")
    return load_robot(path)


def refused(text: str, old: str, new: str, message: str) -> None:
    """A text with something else in it is refused in a short line, with file and place."""
    assert old in text
    suffix = ".urdf" if "<robot" in text else ".sdf"
    with pytest.raises(InputError, match=rf"^/.*\{suffix}: .*{message}") as error:
        loaded(text.replace(old, new), suffix)
    assert "\n" not in str(error.value) and len(str(error.value)) < 600


@functools.cache
def _folder() -> Path:
    folder = tempfile.TemporaryDirectory()
    atexit.register(folder.cleanup)
    return Path(folder.name)
