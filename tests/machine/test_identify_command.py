"""`sdt-drake identify` from a recording to runs of what it writes."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from helpers.robots import URDF, loaded
from helpers.simulated_recordings import course

import sdt_drake as sdt
from sdt_drake.io.tables import write_table
from sdt_drake.machine.identify.files import FILES
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.parsed import parts_of
from sdt_drake.studies.runs import Runner
from sdt_drake.studies.study import load_study

COULOMB, VISCOUS = [8.0, 3.0], [4.0, 2.0]


@pytest.fixture
def recording(desk):
    """An arm whose lower link is 0.5 kg heavier than in its file, with friction and noise."""
    arm, rng = loaded(URDF, ".urdf"), np.random.default_rng(5)
    time, q, v, vd = course(replace(arm, velocity_limit=np.full(2, 5.0)), rng, 5.0, 200.0)
    tau = inverse_dynamics(deviated(arm, Deviation("lower", payload_mass=0.5)), q, v, vd)
    tau = tau + np.multiply(COULOMB, np.sign(v)) + np.multiply(VISCOUS, v)
    tau = tau + 0.1 * rng.normal(size=tau.shape)
    write_table(desk / "run.csv", time, {"q": q, "tau": tau})
    (desk / "arm.urdf").write_text(URDF, encoding="utf-8")
    return "arm.urdf", "run.csv"


def test_a_recording_becomes_a_robot_a_scenario_and_a_study_that_run(
    good, recording, desk, undrawn
):
    out = desk / "identified"
    said = good("identify", *recording, "--out", out, "--cutoff", "8").out
    assert "base parameters of links and motors" in said
    assert {path.name for path in out.iterdir()} >= {*FILES}

    found = sdt.identify(*recording, cutoff=8)  # the same from Python
    friction = sdt.load(out / "scenario.yaml").plant.friction
    assert friction == found.plant_friction.friction
    np.testing.assert_allclose(friction.coulomb, COULOMB, rtol=0.05)
    np.testing.assert_allclose(friction.viscous, VISCOUS, rtol=0.05)
    mass, com, _ = parts_of(sdt.load_robot(out / "robot.sdf").plant.GetBodyByName("lower"))
    assert mass * com[0] == pytest.approx(2.5 * 0.3, rel=0.02)  # kg m, what gravity tells

    rows = list(csv.DictReader((out / "parameters.csv").open()))
    stds = [float(row["std"]) for row in rows if row["kind"] == "base"]
    assert len(stds) == len(found.unknown.base.words) and min(stds) > 0
    told = {row["name"]: (float(row["value"]), float(row["std"] or "nan"))
            for row in rows if row["kind"] == "friction"}  # fmt: skip
    files, names = found.plant_friction, sdt.load_robot(recording[0]).joint_names
    for kind, std in zip(("coulomb", "viscous"), files.std, strict=True):
        for value, spread, name in zip(getattr(friction, kind), std, names, strict=True):
            assert told[f"{kind} of {name}"] == pytest.approx((value, spread))
    judged = good("judge", out / "robot.sdf", recording[1], "--friction", out / "friction.yaml").out
    left = {line.split("  ")[0]: line.split()[-2:] for line in judged.splitlines()}
    assert max(map(float, left["robot and friction"])) < 3
    written = [sdt.load_robot(out / f"robot.{kind}") for kind in ("sdf", "urdf")]
    masses = [robot.mass_matrix(robot.context_at_zero()) for robot in written]
    np.testing.assert_allclose(*masses, rtol=1e-12)
    np.testing.assert_array_equal(*(robot.damping for robot in written))
    assert min(map(float, left["robot without friction"])) > 10

    assert np.abs(sdt.simulate(sdt.load(out / "scenario.yaml")).position_error).max() < 0.02
    device = sdt.design(sdt.load(out / "uncertain.yaml")).device.simulated
    assert device.sdf == sdt.load_robot(out / "robot.sdf").sdf  # nothing is uncertain yet
    study, base = load_study(out / "uncertainty.yaml")
    assert {"links_1", "coulomb_1", "viscous_2"} < {variable.name for variable in study.variables}
    row = Runner(study, base).run(0)
    assert (row.status, row.reason) == ("ok", "")


def test_what_spoils_a_fit_asks_before_files_are_written(refuse, call, recording, desk, undrawn):
    columns = desk / "kilo.yaml"
    columns.write_text("torque_factor: [0.001, 0.001]\n")
    command = ("identify", *recording, "--columns", columns, "--cutoff", "8", "--out", "spoilt")
    refuse(*command, late=True, saying=("nothing is written: unit (see", "or --anyway"))
    done = call(*command, "--anyway")
    assert done.code == 0 and (desk / "spoilt" / "robot.sdf").exists()
    assert "is it in kN m? (torque_factor: [1000, 1000] in the mapping file)" in done.out
