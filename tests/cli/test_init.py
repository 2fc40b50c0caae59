"""`init`: files to make one's own, every one of which runs."""

import re
import shlex
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np
import pytest
from helpers import command_line
from helpers.robots import RATE_TABLE, SIX, URDF

from sdt_drake.analysis.frequency_response import frequency_response
from sdt_drake.io.errors import InputError
from sdt_drake.io.resources import models_dir
from sdt_drake.machine.drive_files.drives import load_drives
from sdt_drake.machine.recordings.columns import load_columns
from sdt_drake.motion import load_plan, margins
from sdt_drake.robot.robot import load_robot
from sdt_drake.robot.shapes import mesh_files
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.studies.job import make_job
from sdt_drake.studies.sizing import load_sizing
from sdt_drake.studies.study import load_study

call, good, desk, refuse = (getattr(command_line, x) for x in ("call", "good", "desk", "refuse"))


@pytest.fixture
def own(good, desk, monkeypatch):
    """A folder that `init` has filled; what it printed."""
    out = good("init", "own").out
    monkeypatch.chdir(desk / "own")
    return out


def test_commands_that_init_prints_run(own, good, tmp_path):
    lines = re.findall(r"^(sdt-drake .+?)   ", own, re.MULTILINE)
    ran = {line.split()[1]: line.split()[1:] for line in lines}
    assert list(ran) == ["simulate", "view", "tune", "pilot", "plan", "study"]
    good(*ran["plan"])
    # Motor side, by hand: m a² of what is at the end of the arm, m d² of the payload, the motor's.
    arm = 900 + 800 * 0.2**2 + (120 + 90 + 120) * 1.8**2 + 50 + 20 + 10
    largest = [arm / 50**2 + 0.02, 40 + 18 + 4 + 1.2 + 0.15, 18 + 9 + 1.2 + 0.08]
    name, value = re.search(r"single fields: --set (.*)=(.*)\n", own).groups()
    make_design(load_scenario("scenario.yaml", {name: value}))
    design = make_design(load_scenario("scenario.yaml"))
    np.testing.assert_allclose(design.inertia.maximum, largest, rtol=1e-6)
    study, base = load_study(ran["study"][2])
    assert (len(study), make_job(study, base).runner(tmp_path).run(0).status) == (16, "ok")


# --- of a robot of one's own ----------------------------------------------------------------------

STOPS = "<velocity>1</velocity><lower>0.5</lower><upper>2.5</upper>"
ROBOTS = {
    "rate_table.urdf": RATE_TABLE,
    "slow.sdf": command_line.ARM.replace("<velocity>5</velocity>", STOPS),  # without the angle 0
    "six.urdf": SIX,
}


MESH = "<visual name='v'><geometry><mesh><uri>{}</uri></mesh></geometry></visual></link>"
FOLDERS = ["plain", "a&b", "<'a\">", "50%20", "ü [1]"]


@pytest.mark.parametrize(
    ("folder", "written"), [*((x, "{}") for x in FOLDERS), ("<'a\">", " {}\n")]
)
def test_init_keeps_meshes_reachable(good, desk, folder, written):
    (desk / folder).mkdir()
    (desk / folder / "link.obj").write_text("v 0 0 0")
    mesh = MESH.format(written.format(escape(f"{folder.replace('%', '%25')}/link.obj")))
    (desk / "arm.sdf").write_text(command_line.ARM.replace("</link>", mesh, 1))
    good("init", "--robot", "arm.sdf", "deep/mine")
    [path] = mesh_files(load_robot("deep/mine/arm.sdf")).values()
    assert path.samefile(desk / folder / "link.obj")


@pytest.mark.parametrize("name", ROBOTS)
def test_init_files_of_an_own_robot_fit_it_and_run(good, desk, monkeypatch, name):
    (desk / name).write_text(ROBOTS[name], encoding="utf-8")
    good("init", "--robot", name, "mine")
    monkeypatch.chdir(desk / "mine")
    mine = load_robot(name)
    design = make_design(load_scenario("scenario.yaml"))
    assert design.device.simulated.joint_names == mine.joint_names
    n1 = design.device.simulated.envelope.n1 / mine.gear_ratio
    np.testing.assert_allclose(n1, mine.velocity_limit, rtol=1e-4)
    assert np.degrees(np.abs(simulate(design).q - design.reference.tracked.q)).max() < 0.2
    assert frequency_response(design).stable.all()
    # The planned motion is the commanded one, within 40 % of the speeds and 70 % of the torques.
    plan = load_plan("motion.yaml", mine)
    np.testing.assert_allclose(plan.motion.q, plan.commanded.q, atol=1e-9)
    share = margins(mine, plan.motion).share
    assert share["torque"].max() <= 0.7 and share["speed"].max() <= 0.4 * (1 + 1e-9)
    assert all(np.ptp(plan.motion.q, axis=0) > np.radians(0.4))

    assert len(load_drives("drives.yaml", mine.n).axes) == mine.n
    sizing, base = load_sizing("sizing.yaml")
    assert len(sizing.study()) == 2 * 3 ** min(mine.n, 3)
    assert make_job(sizing.study(), base).runner(Path(".")).run(0).status == "ok"
    study, base = load_study("study.yaml")
    assert len(study) == 16 and base.robot.endswith(name)
    for file in Path().glob("*.yaml"):  # editors find the schemas wherever the folder is
        text = file.read_text(encoding="utf-8")
        schema = Path(text.splitlines()[0].split("$schema=")[1])
        assert not schema.is_absolute() and str(desk) not in text
        assert schema.read_text() == (models_dir() / schema).read_text()


FINGER = (
    "<link name='finger'><inertial><mass value='0.1'/><inertia ixx='1e-4' iyy='1e-4' izz='1e-4'/>"
    "</inertial></link><joint name='grip' type='prismatic'><origin xyz='0.4 0 0'/>"
    "<parent link='lower'/><child link='finger'/><axis xyz='0 1 0'/>"
    "<limit effort='10' velocity='0.1' lower='0' upper='0.04'/></joint></robot>"
)
LIGHT = """<robot name="light"><link name="base"/>
<link name="l1"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>
  <inertia ixx="0.004" iyy="0.004" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="l2"><inertial><origin xyz="0 0 0.03"/><mass value="0.15"/>
  <inertia ixx="4.3e-5" iyy="1.0e-4" izz="1.2e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><axis xyz="0 1 0"/>
  <limit effort="100" velocity="3" lower="-2" upper="2"/><dynamics friction="1.5"/></joint>
<joint name="j2" type="revolute"><origin xyz="0 0 0.25"/><parent link="l1"/><child link="l2"/>
  <axis xyz="0 0 1"/><limit effort="100" velocity="1" lower="-3" upper="3"/></joint></robot>"""


def test_init_assumes_rotors_and_takes_over_friction_of_a_published_arm(good, desk, monkeypatch):
    """100 N m turn a motor alone with 100 rad/s², so I = 1 kg m²; link 2 has 1.2e-4 kg m²."""
    (desk / "arm.urdf").write_text(LIGHT, encoding="utf-8")
    out = good("init", "--robot", "arm.urdf", "mine").out
    assert "note: arm.urdf has no rotor inertia of joint 1 'j1' and joint 2 'j2'; motors.y" in out
    assert "note: plant.friction.coulomb in scenario.yaml is the <friction> of arm.urdf" in out
    monkeypatch.chdir(desk / "mine")
    scenario = load_scenario("scenario.yaml")
    design = make_design(scenario)
    np.testing.assert_allclose(design.nominal.rotor_inertia, [1, 1])
    np.testing.assert_allclose(design.nominal.effort_limit, [100, 100])
    assert scenario.plant.friction.coulomb == (1.5, 0) and not design.nominal.lacks
    np.testing.assert_allclose(design.inertia.maximum[1], 1 + 1.2e-4, rtol=1e-9)
    alone = scenario.changed({"device.motors": ["j1", ""]})
    with pytest.raises(InputError, match=r"joint 2 a pole at .*; it has no rotor inertia, by <dr"):
        make_design(alone)
    shown = good("view", "arm.urdf", "--out", "r.html").out
    assert "note: no rotor inertia of any joint is known" in shown
    assert "note: the file's <friction> [1.5, 0] N m is left out: plant.friction.coulomb" in shown
    short = ("--set", "motion=../../given/arm.yaml")
    quiet = good("simulate", "scenario.yaml", *short).out
    assert "rotor" not in quiet
    axis = ("--set", "device.motors=[]", "--set", "drive.n1=[9,9]", "--set", "drive.n0=[1e9,1e9]")
    told = good("simulate", "scenario.yaml", *short, *axis).out
    assert "note: no rotor inertia of any joint is known" in told


def test_init_of_held_joints_writes_them_fixed_and_keeps_the_rest_of_the_text(good, desk):
    text = URDF.replace("</robot>", FINGER).replace("<link", "<!-- ü --><link", 1)
    (desk / "arm.urdf").write_text(text, encoding="utf-8")
    good("init", "--robot", "arm.urdf", "--hold", "grip=0.03", "mine")
    written = (desk / "mine" / "arm.urdf").read_text(encoding="utf-8")
    start, end = text.index("<joint name='grip'"), text.index("</joint></robot>")
    assert written.startswith(text[:start]) and written.endswith(text[end:])
    assert written[start : -len(text[end:])] == (
        '<joint name="grip" type="fixed"><origin xyz="0.4 0.03 0.0"/>'
        "<parent link='lower'/><child link='finger'/>"
    )
    held, mine = load_robot(desk / "arm.urdf", hold="grip=0.03"), load_robot(desk / "mine/arm.urdf")
    # A scenario holds the joints of the published file as well, and so does a tip.
    scenario = load_scenario(desk / "mine" / "scenario.yaml", {"robot": str(desk / "arm.urdf")})
    ways = {"hold": ["grip=0.03"]}, {"tip": "lower", "hold": "grip=0.03"}
    own = [make_design(scenario.changed(way)).nominal for way in ways]
    M = [robot.plant.CalcMassMatrix(robot.context_at_zero()) for robot in (held, mine)]
    np.testing.assert_array_equal(*M)
    for robot in own:
        assert robot.joint_names == held.joint_names and dict(robot.held) == {"grip": 0.03}


NAMES = ['it\'s "q" <x>', "a # c: ${x}", "[ü] & 50%20"]
"""Names with a meaning to YAML, XML, a shell, a template or a web address."""


@pytest.mark.parametrize("name", NAMES)
def test_any_name_of_folder_file_robot_and_joint_stays_that_name(good, desk, monkeypatch, name):
    text, quoted = command_line.ARM, quoteattr(name)
    for old in ("name='elbow'", "relative_to='elbow'", "name='two_links'"):
        text = text.replace(old, f"{old.partition('=')[0]}={quoted}")
    (desk / f"{name}.sdf").write_text(text, encoding="utf-8")
    out = good("init", "--robot", f"{name}.sdf", name).out
    (cd,) = (line for line in out.splitlines() if line.startswith("cd "))
    assert shlex.split(cd) == ["cd", name] and f"view {shlex.quote(name + '.sdf')} " in out
    monkeypatch.chdir(desk / name)
    design = make_design(load_scenario("scenario.yaml"))
    assert (design.nominal.name, design.nominal.joint_names) == (name, ("shoulder", name))
    assert Path(design.scenario.robot).name == f"{name}.sdf"
    assert load_sizing("sizing.yaml")[0].study() and load_study("study.yaml")[0].variables
    assert len(load_drives("drives.yaml", 2).axes) == 2 and load_columns("columns.yaml").q
