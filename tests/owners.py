"""Robots as their owners bring them: a rate table, arms with six and seven joints; no shapes."""

from math import pi

HALF = pi / 2

RATE_TABLE = """<?xml version="1.0"?>
<robot name="rate_table">
  <link name="world"/>
  <link name="base_link">
    <inertial><origin xyz="0 0 0.4"/><mass value="900"/>
      <inertia ixx="80" ixy="0" ixz="0" iyy="80" iyz="0" izz="60"/></inertial>
  </link>
  <joint name="fix" type="fixed"><parent link="world"/><child link="base_link"/></joint>
  <link name="outer">
    <inertial><origin xyz="0 0 0"/><mass value="180"/>
      <inertia ixx="22" ixy="0" ixz="0" iyy="28" iyz="0" izz="34"/></inertial>
  </link>
  <link name="middle">
    <inertial><origin xyz="0 0 0.01"/><mass value="85"/>
      <inertia ixx="7" ixy="0" ixz="0" iyy="6" iyz="0" izz="9"/></inertial>
  </link>
  <link name="inner">
    <inertial><origin xyz="0.005 0 0.02"/><mass value="60"/>
      <inertia ixx="2.1" ixy="0" ixz="0" iyy="2.2" iyz="0" izz="3.0"/></inertial>
  </link>
  <joint name="outer_axis" type="continuous"><parent link="base_link"/><child link="outer"/>
    <origin xyz="0 0 1.2"/><axis xyz="0 0 1"/><limit effort="900" velocity="7"/></joint>
  <joint name="middle_axis" type="continuous"><parent link="outer"/><child link="middle"/>
    <axis xyz="0 1 0"/><limit effort="420" velocity="10.5"/></joint>
  <joint name="inner_axis" type="continuous"><parent link="middle"/><child link="inner"/>
    <axis xyz="1 0 0"/><limit effort="120" velocity="17"/></joint>
</robot>
"""
"""Three axes that meet in a point, as published motors turn them."""


def _arm(name: str, joints: list[tuple], limits: list[tuple[float, float, float, float]]) -> str:
    """A chain of joints: xyz and rpy of each in the link before, mass [kg], centre of mass [m] and
    radius of gyration [m] of its link; limits: effort, speed, lower and upper."""
    parts = ['<link name="base_link"/>']
    before = "base_link"
    for k, ((xyz, rpy, mass, com, r), (effort, v, low, high)) in enumerate(
        zip(joints, limits, strict=True), start=1
    ):
        moment = f"{mass * r**2:.5f}"
        parts.append(
            f'<link name="link_{k}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>'
            f'<inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/>'
            f'</inertial></link><joint name="joint_{k}" type="revolute">'
            f'<parent link="{before}"/><child link="link_{k}"/><axis xyz="0 0 1"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/>'
            f'<limit effort="{effort}" velocity="{v}" lower="{low}" upper="{high}"/></joint>'
        )
        before = f"link_{k}"
    return f'<robot name="{name}">{"".join(parts)}</robot>'


SIX = _arm(
    "six",
    [
        ("0 0 0.1625", "0 0 0", 3.76, "0 -0.0256 0.0019", 0.05),
        ("0 0 0", f"{HALF} 0 0", 8.06, "-0.2125 0 0.1134", 0.15),
        ("-0.425 0 0", "0 0 0", 2.85, "-0.15 0 0.0265", 0.13),
        ("-0.3922 0 0.1333", "0 0 0", 1.37, "0 -0.0018 0.0163", 0.04),
        ("0 -0.0997 0", f"{HALF} 0 0", 1.3, "0 0.0018 0.0163", 0.04),
        ("0 0.0996 0", f"{HALF} {pi} {pi}", 0.365, "0 0 -0.0012", 0.03),
    ],
    [(150, pi, -2 * pi, 2 * pi)] * 2 + [(150, pi, -pi, pi)] + [(28, pi, -2 * pi, 2 * pi)] * 3,
)
"""An arm with parallel axes 2, 3, 4 and a wrist with offsets, of about a UR5e's numbers."""

SEVEN = _arm(
    "seven",
    [
        ("0 0 0.333", "0 0 0", 4.97, "0.004 0.002 -0.05", 0.2),
        ("0 0 0", f"{-HALF} 0 0", 0.65, "-0.003 -0.029 0.003", 0.1),
        ("0 -0.316 0", f"{HALF} 0 0", 3.23, "0.0275 0.0393 -0.0665", 0.1),
        ("0.0825 0 0", f"{HALF} 0 0", 3.59, "-0.0532 0.1044 0.0275", 0.1),
        ("-0.0825 0.384 0", f"{-HALF} 0 0", 1.23, "-0.0119 0.041 -0.0384", 0.15),
        ("0 0 0", f"{HALF} 0 0", 1.67, "0.0601 -0.0141 -0.0105", 0.06),
        ("0.088 0 0", f"{HALF} 0 0", 0.74, "0.0105 -0.0043 0.0616", 0.12),
    ],
    [
        (87, 2.175, -2.8973, 2.8973), (87, 2.175, -1.7628, 1.7628), (87, 2.175, -2.8973, 2.8973),
        (87, 2.175, -3.0718, -0.0698), (12, 2.61, -2.8973, 2.8973), (12, 2.61, -0.0175, 3.7525),
        (12, 2.61, -2.8973, 2.8973),
    ],
)  # fmt: skip
"""An arm whose joint 4 does not reach 0, of about a Panda's numbers."""
