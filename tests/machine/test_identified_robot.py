"""What is written and told of an identified robot: links, intervals, the result in words."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import dh
import numpy as np
import pytest
from known_truth import COULOMB_TRUE, VISCOUS_TRUE, changed, motion, recorded_of, true_robot

from sdt_drake.machine.identify import model
from sdt_drake.machine.identify.files import recorded_motion
from sdt_drake.machine.identify.model import plant_friction
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.identify.suspicions import inconsistent
from sdt_drake.machine.recordings import Recorded
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import load_robot
from sdt_drake.show.reports.identification import links_table, result


@pytest.fixture(scope="module")
def true(robot):
    return true_robot(robot)


@pytest.fixture(scope="module")
def found(robot, true):
    return identify(robot, [recorded_of(true)])


def light_handed(folder, name, mass, com, radius):
    """A UR10 whose last link is a body of its own, with rotors."""
    table = replace(
        dh.UR10,
        name=name,
        mass=[*dh.UR10.mass[:5], mass],
        com=[*dh.UR10.com[:5], com],
        rotor_inertia=[1.8, 1.8, 0.9, 0.2, 0.2, 0.2],
    )
    begin, last = table.sdf.split('<link name="link_6">')
    own = re.sub("<(i..)>[^<]*<", rf"<\1>{mass * radius**2!r}<", last)
    (folder / f"{name}.sdf").write_text(f'{begin}<link name="link_6">{own}')
    return load_robot(folder / f"{name}.sdf")


def test_a_payload_far_heavier_than_its_link_is_written_as_it_was_measured(tmp_path):
    """2.8 kg at a hand of 200 g: its links in the file would rather have it heavier and nearer."""
    tool, own, at, own_at = 2.805, 0.2, np.array([0.03, 0.02, 0.1]), np.array([0.0, 0.0, -0.02])
    whole = own + tool
    centre = tuple(((tool * at + own * own_at) / whole).tolist())
    nominal = light_handed(tmp_path, "light", own, (0.0, 0.0, -0.02), 0.02)
    true = light_handed(tmp_path, "loaded", whole, centre, 0.05)
    rng, time = np.random.default_rng(1), np.arange(0, 20, 0.005)
    omega = 2 * np.pi * np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    angle = omega * time[:, None, None] + rng.uniform(0, 6, (6, 5))
    size = rng.uniform(0.2, 0.5, (6, 5)) / omega
    waves = (np.sin(angle), omega * np.cos(angle), -(omega**2) * np.sin(angle))
    q, v, vd = (np.sum(size * wave, axis=2) for wave in waves)
    tau = inverse_dynamics(true, q, v, vd) + 5 * np.tanh(v / 0.01) + 3 * v
    tau = tau + 0.1 * np.sqrt(np.mean(tau**2, axis=0)) * rng.normal(size=tau.shape)
    recorded = Recorded(Path("tool.csv"), time, {"q": q, "tau": tau})
    found = identify(nominal, [recorded], only="payload", payload="link_6")
    (link,), (pseudo,) = found.consistent.links, found.consistent.pseudo
    mass, com, _ = link.inertial(pseudo)
    at = found.unknown.base.names.index("mass of link_6")
    at = np.flatnonzero(found.unknown.base.independent == at)[0]
    std = np.sqrt(found.estimate.covariance[at, at])
    assert abs(mass - found.estimate.beta[at]) < 1.1 * std
    assert abs(mass - whole) < 4 * std < 0.08
    assert np.linalg.norm(com - centre) < 0.01
    free = found.left(found.estimate.torque(found.equations), held_out=True)
    assert np.all(found.left(found.predicted, held_out=True) < 1.1 * free)
    assert not any("physically consistent" in line for line in found.warnings)


def test_joints_of_which_links_explain_less_are_told_with_numbers(found):
    eq = found.equations
    free = found.estimate.torque(eq)
    error = np.where(np.arange(len(eq.time)) % 2, 1.0, -1.0) * np.std(eq.tau[eq.fit], axis=0)[1]
    worse = free.copy()
    worse[:, 1] += 0.05 * error
    (line,) = inconsistent(eq, free, worse)
    assert re.match(
        r"joint 2: physically consistent links do not explain 5\.\d % .* \d\.\d %$", line
    )
    worse[:, 1] += 0.2 * error
    (line,) = inconsistent(eq, free, worse)
    assert line.endswith("such as a counterbalance, a spring or a cable")


def rubbed(recorded, share):
    """The recording on a day on which all friction is so much more than the true one."""
    v = motion_of(recorded)[1]
    more = share * (COULOMB_TRUE * np.sign(v) + VISCOUS_TRUE * v)
    return changed(recorded, tau=recorded.signals["tau"] + more)


def motion_of(recorded):
    q = recorded.signals["q"]
    return q, np.gradient(q, recorded.time, axis=0)


def test_friction_of_other_days_is_within_its_interval(robot, true):
    """Of two recordings with a fifth less and more than on the day after; alone, each knows only
    its own."""
    one = recorded_of(true, seconds=30.0)
    days = [rubbed(one, -0.2), rubbed(recorded_of(true, seed=1), 0.2)]
    alone, both = (plant_friction(identify(robot, days[:count])) for count in (1, 2))
    wanted = np.array([COULOMB_TRUE, VISCOUS_TRUE])
    off = [
        np.abs([files.friction.coulomb, files.friction.viscous] - wanted) / files.std
        for files in (alone, both)
    ]
    assert np.mean(off[0] < 1.96) < 0.5 and np.all(off[1] < 1.96)
    assert np.all(alone.between == 0)
    assert np.all((both.between > 0.15) & (both.between < 0.8))
    assert np.all(both.std < wanted)
    values = np.array([both.friction.coulomb, both.friction.viscous])
    assert np.all(both.std >= both.between * values)  # of another day, not of their mean


def test_spread_between_recordings_is_of_all_joints_where_one_has_less():
    days = np.array([[[1.0, 0.0], [0.0, 0.0]], [[-1.0, 0.0], [0.0, 0.0]]])
    found = model._between(days, np.array([[10.0, 1.0], [5.0, 0.0]]))
    one = np.sqrt(2) / 10
    np.testing.assert_allclose(found, [[one, 0], [one / np.sqrt(2), 0]])
    assert not model._between(days[:1], np.ones((2, 2))).any()


def test_a_motion_that_is_judged_by_itself_is_named(robot, true):
    q = motion(true)[1]
    q = (q - q.mean(axis=0)) * np.hanning(len(q))[:, None]
    v = np.gradient(q, 0.01, axis=0)
    tau = inverse_dynamics(true, q, v, np.gradient(v, 0.01, axis=0)) + 30 * np.tanh(v / 0.01)
    for more, expected in ((0, False), (len(q) // 2, True)):
        rows = np.r_[: len(q), :more]
        recorded = Recorded(
            Path("r.csv"), 0.01 * np.arange(len(rows)), {"q": q[rows], "tau": tau[rows]}
        )
        notes = identify(robot, [recorded], cutoff=5.0).notes
        assert any("repeat the fitted motion" in line for line in notes) == expected


def test_the_result_comes_first_with_its_numbers(found):
    eq = found.equations
    exact = replace(found, predicted=eq.tau * (1 - np.array([0.04, 0.051, 0.02, 0.2])), warnings=())
    eq = replace(eq, nominal=eq.tau * np.array([0.5, 0.3, 0.0, 0.9]))
    first, following = result(replace(exact, equations=eq))
    assert first == (
        "sdt: 2.0 to 20 % of the joints' torques are not explained now (RMS, held out), with the "
        "file as it is 10 to 100 %"
    )
    assert "identify --judge" in following
    _, following = result(replace(found, warnings=("one", "two")))
    assert following.startswith("next: the 2 warnings below")


def test_masses_that_torques_tell_in_sums_alone_are_said_to_be(robot, found):
    table = links_table(found)
    of = {row[0]: row[3] for row in table.rows}
    assert of["payload"] == of["gondola"] == "measured in sums only"
    payload = identify(robot, [recorded_of(robot)], only="payload", cutoff=3.0)
    assert [row[3] for row in links_table(payload).rows] == ["measured"]


def test_the_recorded_motion_is_as_slow_as_the_limits_ask_for(found, true):
    inf = np.full(true.n, np.inf)
    limits = {"velocity_limit": inf, "acceleration_limit": inf, "effort_limit": inf}
    strong = replace(true, envelope=None, **limits)
    motion, notes = recorded_motion(found, strong, 0.005)
    assert notes == [] and motion.duration == pytest.approx(20, abs=0.1)
    few = replace(strong, velocity_limit=0.5 * np.abs(motion.v).max(axis=0))
    slow, (said,) = recorded_motion(found, few, 0.005)
    assert re.match(r"motion.csv: the recorded motion, 2\.\d* times slower", said)
    assert np.all(np.abs(slow.v).max(axis=0) < few.velocity_limit)
    np.testing.assert_allclose(slow.q[-1], motion.q[-1], atol=0.01)
    tau, still = (inverse_dynamics(true, motion.q, k * motion.v, k * motion.vd) for k in (1, 0))
    standing = np.abs(still).max(axis=0)
    weak = replace(strong, effort_limit=standing + 0.4 * (np.abs(tau).max(axis=0) - standing))
    slow, (said,) = recorded_motion(found, weak, 0.005)
    assert "times slower" in said and slow.duration > motion.duration
    tau = inverse_dynamics(true, slow.q, slow.v, slow.vd)
    assert np.all(np.abs(tau).max(axis=0) < weak.effort_limit)
    _, said = recorded_motion(found, replace(strong, effort_limit=0.5 * standing), 0.005)
    assert "joint 2 'roll' needs" in " ".join(said) and "raise <effort>" in said[0]
