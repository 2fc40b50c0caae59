"""What is identified, against a truth that is known."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.known_truth import COULOMB_TRUE, VISCOUS_TRUE, changed, motion, recorded_of, true_robot
from helpers.simulated_recordings import course, file_robot

from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import write_table
from sdt_drake.machine.diagnose.fit import weakly_excited
from sdt_drake.machine.identify.base_parameters import Unknown, rigid_parameters
from sdt_drake.machine.identify.consistency import (
    _Space,
    links_of,
    motor_scale,
    nearest_consistent,
)
from sdt_drake.machine.identify.equations import equations
from sdt_drake.machine.identify.estimation import estimate
from sdt_drake.machine.identify.filtering import compared, stretches, zero_phase_low_pass
from sdt_drake.machine.identify.friction import USUAL, VISCOUS
from sdt_drake.machine.identify.judge import judge
from sdt_drake.machine.identify.model import (
    directions,
    identified_robot,
    save_robot,
)
from sdt_drake.machine.identify.procedure import belief, identify
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.coupling import TURNS_WITH
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import edited, load_robot
from sdt_drake.robot.sdf import DRAKE
from sdt_drake.show.figures.identification import residuals_figure
from sdt_drake.show.reports.identification import friction_notes, friction_table, result

ROTOR = f"{DRAKE}rotor_inertia"


def test_identified_robot_has_the_true_torques(found, robot, true, tmp_path):
    base, S = found.unknown.base, found.estimate.covariance
    truth = base.combination @ rigid_parameters(true)
    std = np.sqrt(np.diagonal(S))
    assert np.all(np.abs(found.estimate.beta - truth) < 4 * std[: len(truth)])
    assert np.all(found.left(found.predicted, held_out=True) < 0.02)
    assert np.all(found.left(found.equations.nominal, held_out=True) > 0.05)
    files = found.plant_friction
    values = files.friction.coulomb, files.friction.viscous
    rows = zip(values, files.std, (COULOMB_TRUE, VISCOUS_TRUE), strict=True)
    for values, std, wanted in rows:
        assert np.all(np.abs(values - wanted) < 0.03 * wanted + 4 * std)
        assert np.all(std < 0.15 * wanted)
    # The file loads without any repair, with its shapes, and moves like the true device.
    save_robot(found, tmp_path / "robot.sdf")
    again = load_robot(tmp_path / "robot.sdf")
    assert "<visual" in (tmp_path / "robot.sdf").read_text()
    np.testing.assert_allclose(rigid_parameters(again), rigid_parameters(identified_robot(found)))
    _, q, v, vd = motion(robot)
    expected = inverse_dynamics(true, q, v, vd)
    left = np.std(inverse_dynamics(again, q, v, vd) - expected, axis=0)
    assert np.all(left < 0.01 * np.std(expected, axis=0))


def test_rotors_and_friction_of_coupled_motors_are_found():
    """Motor 3 turns at 80 (v_3 + 0.8 v_2). Its rotor is heavier than the file says; motors rub."""
    arm, ratio = file_robot("arm3"), np.array([100.0, 120.0, 80.0])
    coupling = np.diag(ratio)
    coupling[2, 1] = 64.0

    def couple(root):
        joint = root.find(f".//joint[@name='{arm.joint_names[2]}']")
        ET.SubElement(joint, TURNS_WITH, joint=arm.joint_names[1]).text = "64"

    robot = edited(arm, couple)
    time, q, v, vd = course(arm, np.random.default_rng(3), 40.0, 200.0)
    rotors = arm.rotor_inertia * [1, 1, 1.5]
    coulomb, viscous = [0.08, 0.07, 0.05], [1e-3, 8e-4, 6e-4]
    links = inverse_dynamics(arm, q, v, vd) - arm.reflected_inertia * vd
    speed = v @ coupling.T
    motors = vd @ coupling.T * rotors + coulomb * np.tanh(speed / 0.1) + viscous * speed
    found = identify(
        robot, [Recorded(Path("own.csv"), time, {"q": q, "tau": links + motors @ coupling})]
    )
    assert np.all(found.left(found.predicted, held_out=True) < 0.02)
    assert not any(one.joints for one in found.findings)
    np.testing.assert_allclose(identified_robot(found).rotor_inertia, rotors, rtol=0.05)
    friction = found.plant_friction.friction
    np.testing.assert_allclose(friction.coulomb, ratio * coulomb, rtol=0.05)
    np.testing.assert_allclose(friction.viscous, ratio**2 * viscous, rtol=0.05)


def test_unexcited_links_stay_as_in_the_file(robot):
    exact = identify(robot, [recorded_of(robot, noise=1e-4)])
    for link, pseudo in zip(exact.consistent.links, exact.consistent.pseudo, strict=True):
        size = np.sqrt(np.outer(np.diagonal(link.pseudo), np.diagonal(link.pseudo)))
        assert np.all(np.abs(pseudo - link.pseudo) < 0.02 * size), link.name


@pytest.mark.parametrize("moving", [1.0, 0.4])
def test_intervals_of_95_percent_cover_the_truth(robot, true, moving):
    """Of 95 % intervals, in coloured noise: what the filter leaves of white noise; also where
    joints rest for most of the time."""
    unknown = Unknown.everything(robot)
    (stretch,), _ = stretches(recorded_of(true, noise=0.0))
    clean = equations(robot, unknown, [(0, np.inf, stretch)], 4.0, lambda fastest: (USUAL,))
    rests = (np.arange(len(clean.moves)) % 100 >= 100 * moving)[:, None]
    rigid, friction = (np.where(rests[..., None], 0.0, x) for x in (clean.rigid, clean.friction))
    clean = replace(clean, moves=clean.moves & ~rests, rigid=rigid, friction=friction)
    prior = belief(robot, unknown)
    exact = estimate(clean, prior, [USUAL] * robot.n)
    truth = np.concatenate([exact.beta, exact.friction])
    clean = replace(clean, tau=exact.torque(clean))
    size, period = 0.01 * np.sqrt(np.mean(stretch.tau**2, axis=0)), stretch.period
    rows = compared(len(stretch.tau), 4.0, period)
    rng, inside = np.random.default_rng(2), []
    for _ in range(25):
        noise = zero_phase_low_pass(size * rng.normal(size=stretch.tau.shape), 4.0, period)[rows]
        one = estimate(replace(clean, tau=clean.tau + noise), prior, [USUAL] * robot.n)
        std = np.sqrt(np.diagonal(one.covariance))
        inside.append(np.abs(np.concatenate([one.beta, one.friction]) - truth) < 1.96 * std)
    assert 0.91 < np.mean(inside) < 0.985


def test_estimate_is_the_same_in_any_units_and_hold_out(found):
    eq, prior = found.equations, belief(found.nominal, found.unknown)
    size = np.array([1.0, 30.0, 0.1, 5.0])
    columns = {name: getattr(eq, name) * size[:, None] for name in ("rigid", "friction")}
    larger = replace(eq, tau=eq.tau * size, known=eq.known * size, **columns)
    other = replace(eq, tau=np.where(eq.fit[:, None], eq.tau, 0.0))
    one, *same = (estimate(x, prior, [USUAL] * eq.n) for x in (eq, larger, other))
    for again in same:
        np.testing.assert_allclose(again.beta, one.beta, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(again.friction, one.friction, rtol=1e-6, atol=1e-6)


def test_friction_is_the_likeliest_given_the_consistent_links(found):
    r = len(found.estimate.beta)
    links = found.consistent.beta - found.estimate.beta
    friction = found.friction - found.estimate.friction
    size = np.sqrt(np.diagonal(found.estimate.misfit))
    information = np.linalg.inv(found.estimate.misfit / np.outer(size, size))
    change = np.concatenate([links, friction]) / size
    slope = information[r:] @ change
    assert np.abs(slope).max() < 1e-3 * np.abs(information[r:, :r] @ change[:r]).max()


def test_friction_alone_is_found_by_its_law(robot):
    recorded, offset = recorded_of(robot), [700.0, -400.0, 0.0, 20.0]
    found = identify(
        robot, [changed(recorded, tau=recorded.signals["tau"] + offset)], only="friction"
    )
    friction = found.plant_friction.friction
    np.testing.assert_allclose(friction.coulomb, COULOMB_TRUE, rtol=0.04)
    np.testing.assert_allclose(friction.offset, offset, rtol=0.01, atol=4)
    same = rigid_parameters(identified_robot(found))
    np.testing.assert_allclose(same, rigid_parameters(robot), rtol=1e-12)
    shape = np.tanh(motion(robot)[2] / 0.3) * COULOMB_TRUE * 3
    found = identify(
        robot, [changed(recorded, tau=recorded.signals["tau"] + shape)], only="friction"
    )
    assert all(one.name.startswith("sigmoid") for one in found.estimate.laws)


def test_damping_of_the_file_above_the_friction_is_not_written(robot, tmp_path):
    """A placeholder of 3000 N m s/rad, as files of makers have: the written robot has the friction
    that was found, and the first sentence is about it."""

    def damp(root):
        for axis in root.iter("axis"):
            ET.SubElement(ET.SubElement(axis, "dynamics"), "damping").text = "3000"

    placeholder = edited(robot, damp)
    assert np.all(placeholder.damping == 3000)
    recorded = recorded_of(robot)
    found = identify(placeholder, [recorded], only="friction")
    assert np.all(identified_robot(found).damping == 0)
    friction = found.plant_friction.friction
    np.testing.assert_allclose(friction.coulomb, COULOMB_TRUE, rtol=0.05)
    np.testing.assert_allclose(friction.viscous, VISCOUS_TRUE, rtol=0.1)
    assert friction_notes(found, found.plant_friction)[1].startswith(
        "joint 1, 2, 3, 4: the damping of the file (3000, 3000, 3000, 3000 N m s/rad) is more than"
    )
    save_robot(found, tmp_path / "robot.sdf")
    judged = judge(tmp_path / "robot.sdf", [recorded], friction=friction, cutoff=found.cutoff)
    every = np.ones(len(found.equations.tau), dtype=bool)
    written = found.equations.not_explained(found.written, every)
    np.testing.assert_allclose(judged.left, written, rtol=0.05)
    assert np.all(judged.left < 0.02)
    assert result(found)[0].startswith(f"sdt: {_least_to_most(found)} % of the joints' torques")


def _least_to_most(found):
    left = 100 * found.left(found.written, held_out=True)
    return f"{left.min():.2g} to {left.max():.2g}"


@pytest.mark.parametrize("flat", [False, True])
def test_what_the_file_explains_exactly_is_neither_refused_nor_made_worse(flat, tmp_path):
    """A robot without rotors, with light links, one of them flat, and its own torques."""

    def light(root):
        for rotor in root.iter(ROTOR):
            rotor.text = "0"
        for name in ("ixx", "iyy", "izz") if flat else ():
            *_, last = root.iter(name)
            last.text = {"ixx": "0.01", "iyy": "0.01", "izz": "0.02"}[name]

    arm = edited(file_robot("arm3"), light)
    time, q, v, vd = course(arm, np.random.default_rng(1), 20.0, 200.0)
    exact = Recorded(Path("e.csv"), time, {"q": q, "tau": inverse_dynamics(arm, q, v, vd)})
    found = identify(arm, [exact])
    assert np.all(found.left(found.written, held_out=True) < 1e-3)
    heavier = replace(arm, effort_limit=1e3 * arm.effort_limit)  # and so a larger assumed rotor
    found = identify(heavier, [exact])
    assert np.all(found.left(found.written, held_out=True) < 1e-3)


def test_one_exact_parameter_does_not_loosen_the_others(robot):
    """The solver sees links to 1e-6: an exact parameter may deviate by that, the others stay within
    a standard deviation."""
    unknown = Unknown.body(robot, "payload")
    size = np.sqrt(np.diagonal(np.linalg.inv(belief(robot, unknown).precision)))
    beta = unknown.base.combination @ rigid_parameters(robot)[unknown.columns] + 2e-3 * size
    std = 1e-3 * size * np.where(np.arange(len(beta)) == 0, 1e-5, 1.0)
    near = nearest_consistent(robot, unknown, ["payload"], beta, np.diag(std**2), np.diag(std**2))
    missed = (near.beta - beta) / size
    assert np.linalg.norm(missed[1:]) < 1.1e-3 and abs(missed[0]) < 1e-6


def test_motors_have_at_least_their_least_inertia():
    """A solver misses bounds by its tolerance, and torques of a wrong sign ask for less."""
    arm = edited(
        file_robot("arm3"), lambda root: [setattr(x, "text", "0") for x in root.iter(ROTOR)]
    )
    time, q, v, vd = course(arm, np.random.default_rng(2), 10.0, 100.0)
    tau = inverse_dynamics(arm, q, v, vd) * [1, -1, 1]
    tau = tau + 0.01 * np.std(tau, axis=0) * np.random.default_rng(0).normal(size=tau.shape)
    found = identify(arm, [Recorded(Path("e.csv"), time, {"q": q, "tau": tau})], cutoff=5.0)
    assert np.all(found.consistent.motors >= 1e-9 * motor_scale(arm) * (1 - 1e-12))


def test_links_that_are_not_found_are_refused_with_the_joint_that_is_farthest(robot, monkeypatch):
    monkeypatch.setattr(_Space, "closest", lambda *_, **__: None)
    with pytest.raises(InputError, match=r"no physically consistent links .*; joint \d.* farthest"):
        identify(robot, [recorded_of(robot)], cutoff=3.0)


def test_equally_good_friction_laws_widen_the_intervals(found):
    """By half the square of how far the one other law is from the chosen one; and that is said."""
    estimate, apart = found.estimate, 5.0  # N m s/rad
    own = estimate.friction[estimate.friction_of(1)]
    shifted = own + apart * np.array([term == VISCOUS for term in estimate.laws[1].terms])

    def by(*rivals):
        laws = ([], [(replace(estimate.laws[1], name=name), x) for name, x in rivals], [], [])
        return replace(found, estimate=replace(estimate, rivals=laws))

    alone, other = by().plant_friction, by(("another", shifted)).plant_friction
    added = other.std**2 - alone.std**2
    np.testing.assert_allclose(added[1], [0, apart**2 / 2, 0, 0], atol=1e-9)
    np.testing.assert_allclose(added[0], 0, atol=1e-9)
    (day,) = friction_notes(by(), alone)
    assert "from one recording" in day
    _, said = friction_notes(by(("another", shifted)), other)
    assert said.startswith("joint 2: ") and "(another)" in said


def test_bounded_parameter_counts_as_hardly_excited():
    words = ["hx of arm + 2 mass of hand", "Izz of arm"]
    (one,) = weakly_excited(10.0, np.array([1.0, 1.0]), np.array([0.9, 0.1]), words)
    assert one.evidence == {"parameters": 1, "of": 2}
    assert one.sentence.endswith("named after hx of arm")


def test_unidentifiable_parameters_stay_as_in_the_file(robot):
    """Within a standard deviation nothing changes; beyond it, no more than all but that one is
    followed."""
    unknown = Unknown.body(robot, "payload")
    S = np.linalg.inv(belief(robot, unknown).precision)
    base = unknown.base.combination @ rigid_parameters(robot)[unknown.columns]
    along = np.sqrt(np.diagonal(S)) * np.eye(len(base))[0]
    along /= np.sqrt(along @ np.linalg.solve(S, along))
    for size in (0.9, 0.0):
        near = nearest_consistent(robot, unknown, ["payload"], base + size * along, S, S)
        np.testing.assert_allclose(near.pseudo[0], near.links[0].pseudo, rtol=2e-3, atol=2e-3)
    beta, sure = base + 0.1 * along, 1e-4 * S  # ten standard deviations off
    near = nearest_consistent(robot, unknown, ["payload"], beta, S, sure)
    missed = beta - near.beta
    assert np.sqrt(missed @ np.linalg.solve(sure, missed)) == pytest.approx(1, rel=0.01)


def test_parameter_draws_have_the_estimated_covariance(found, tmp_path):
    robot, file, step = identified_robot(found), tmp_path / "s.csv", 1e-3
    along = directions(found, robot)
    assert along.shape[1] == 10 * len(links_of(robot))
    write_table(file, np.arange(1.0, len(along) + 1), {"entry": along}, first="direction")
    changes, r = [], len(found.estimate.beta)
    for one in step * np.eye(len(along)):
        other = deviated(robot, Deviation(spread=str(file), along=one.tolist()))
        change = (rigid_parameters(other) - rigid_parameters(robot))[found.unknown.columns]
        changes.append(found.unknown.base.combination @ change / step)
    drawn = np.sqrt(np.sum(np.square(changes), axis=0))
    # As it was measured, less what the belief in the file knows better, and what is the motors'.
    measured = np.sqrt(np.diagonal(found.estimate.covariance))[:r]
    assert np.all(drawn < 1.02 * measured)
    assert np.median(drawn / measured) > 0.85
    with pytest.raises(InputError, match=r"along: 1 value\(s\), expected"):
        deviated(robot, Deviation(spread=str(file), along=[1.0]))


def test_friction_table_equals_friction_figure(robot):
    """A device without friction: noise makes that of the fit drive, but not that of the table."""
    recorded, v = recorded_of(true_robot(robot)), motion(robot)[2]
    rubs = COULOMB_TRUE * np.sign(v) + VISCOUS_TRUE * v
    found = identify(robot, [changed(recorded, tau=recorded.signals["tau"] - rubs)], cutoff=3.0)
    files = found.plant_friction
    values = np.array([files.friction.coulomb, files.friction.viscous])
    assert np.any(values == 0)
    rows = friction_table(found, files).rows
    for cells, exact, std in zip(rows, values.T, files.std.T, strict=True):
        for cell, value, spread in zip(cells[2:4], exact, std, strict=True):
            told, told_std = map(float, cell.split(" ± "))
            assert abs(told - value) < 0.51 * told_std and abs(told_std - spread) < 0.34 * spread
            assert "e" not in cell
    lines = [line for axes in residuals_figure(found, files).axes for line in axes.lines]
    drawn = [line.get_data() for line in lines if len(line.get_xdata()) == 400][::2]
    for k, (speed, torque) in enumerate(drawn):
        offset = files.friction.offset[k]
        expected = values[0, k] * np.sign(speed) + values[1, k] * speed + offset
        np.testing.assert_allclose(torque, expected, atol=1e-9)
    assert len(drawn) == robot.n
