"""Stops return a share of the energy, as by closed forms of one impact, alone and in a loop."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from sdt_drake.analysis.tracking import stops_passed
from sdt_drake.motion import Motion
from sdt_drake.robot.robot import load_robot
from sdt_drake.run.design import make_design
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import simulate

STOP, SPEED, STIFFNESS = 0.2, 1.5, 3e4  # rad, rad/s, N m/rad


@pytest.fixture
def joint(tmp_path):
    """One joint about a vertical axis through the centre of mass, and its inertia [kg m²]."""
    (file := tmp_path / "joint.sdf").write_text(JOINT)
    robot = load_robot(file)
    return robot, 2.0 + 3**2 * 0.5


JOINT = """<sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="one">
<link name="body"><inertial><mass>4</mass>
<inertia><ixx>2</ixx><iyy>2</iyy><izz>2</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia>
</inertial></link>
<joint name="turn" type="revolute"><parent>world</parent><child>body</child>
<axis><xyz>0 0 1</xyz>
<limit><lower>-0.2</lower><upper>0.2</upper><effort>300</effort></limit></axis>
<drake:rotor_inertia>0.5</drake:rotor_inertia><drake:gear_ratio>3</drake:gear_ratio></joint>
</model></sdf>"""


def impact(robot, speed=SPEED, **stops):
    """Run a joint without torque into its stop; return its design and its recording."""
    motion = Motion.from_speeds(0.001, [0.0], np.zeros((351, 1)))
    plant = {"kind": "coupled", "stops": stops}
    scenario = Scenario(
        plant=plant, controller={"omega_r": 20.0}, period=0.001, simulation={"accuracy": 1e-8}
    )
    design = make_design(scenario, robot=robot, motion=motion)
    loop, builder = make_loop(design, controller="external"), DiagramBuilder()
    builder.AddNamedSystem("loop", loop.diagram)
    free = builder.AddNamedSystem("free", ConstantVectorSource([0.0]))
    builder.Connect(free.get_output_port(), loop.GetInputPort("tau_cmd"))
    return design, simulate(loop, builder.Build(), q=np.zeros(1), v=np.array([speed]))


@pytest.mark.parametrize("speed", [SPEED, -SPEED])
@pytest.mark.parametrize("e", [1.0, 0.7, 0.2])
def test_a_joint_leaves_a_stop_with_e_times_its_speed_and_e_squared_of_its_energy(joint, speed, e):
    """x = v sqrt(J / k) at the deepest, and (1 - e²) J v² / 2 is lost."""
    robot, inertia = joint
    _, run = impact(robot, speed, stiffness=[STIFFNESS], restitution=e)
    lost = inertia / 2 * (speed**2 - run.v[-1, 0] ** 2)
    slow = inertia / 2 * 0.02**2  # the spring falls to e² until 0.02 rad/s
    assert lost == pytest.approx((1 - e**2) * inertia / 2 * speed**2, abs=slow + 1e-4)
    assert np.sign(run.v[-1, 0]) == -np.sign(speed)
    deepest = abs(speed) * np.sqrt(inertia / STIFFNESS)
    assert run.beyond_stop.max() == pytest.approx(deepest, rel=2e-3)  # at samples of 1 ms
    assert run.beyond_stop[-1, 0] == 0


@pytest.mark.parametrize("zeta", [0.1, 0.5])
def test_a_damped_stop_lets_go_where_its_torque_is_zero(joint, zeta):
    """x = v / w_d exp(-zeta w t) sin(w_d t), until x'' = 0: the damper never pulls."""
    robot, inertia = joint
    damping = 2 * zeta * np.sqrt(STIFFNESS * inertia)
    _, run = impact(robot, stiffness=[STIFFNESS], damping=[damping])
    root = np.sqrt(1 - zeta**2)
    turned = np.pi - np.arctan2(2 * zeta * root, 1 - 2 * zeta**2)  # w_d t
    assert -run.v[-1, 0] == pytest.approx(
        SPEED * np.exp(-zeta / root * turned), rel=2e-3
    )  # no damping up to 1e-5 rad


def test_a_run_into_a_stop_is_told(joint):
    robot, _ = joint
    design, run = impact(robot, stiffness=[STIFFNESS], restitution=0.5)
    [line] = stops_passed(run, robot.joint_names, design.scenario.plant.stops.stiffness)
    assert line == (
        f"joint 1 turn runs into its stop at {np.ceil(1e3 * STOP / SPEED) / 1e3:.3f} s, with "
        f"1.5 rad/s, and presses it in by {run.beyond_stop.max():.3g} rad"
    )
    _, passed = impact(robot)
    assert passed.v[-1, 0] == pytest.approx(SPEED, rel=1e-9)
    assert "stops do not act" in stops_passed(passed, robot.joint_names)[0]
