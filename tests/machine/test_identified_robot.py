"""The identified robot: payloads, friction of scenarios, motions as its limits require."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.known_truth import COULOMB_TRUE, VISCOUS_TRUE, changed, motion, recorded_of
from helpers.robots import chain_sdf
from helpers.simulated_recordings import course
from oracles import dh
from scipy.linalg import sqrtm

from sdt_drake.machine.diagnose.fit import inconsistent
from sdt_drake.machine.identify import plant
from sdt_drake.machine.identify.consistency import effect_of, links_of
from sdt_drake.machine.identify.files import recorded_motion
from sdt_drake.machine.identify.judge import judge
from sdt_drake.machine.identify.model import directions
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.device import Friction, friction_parameters, sliding_friction
from sdt_drake.robot.dynamics import inverse_dynamics, torque_groups
from sdt_drake.robot.robot import load_robot
from sdt_drake.robot.sdf import SYMMETRIC, links_by_name
from sdt_drake.robot.xml_files import parse_xml


def test_payload_heavier_than_its_link_is_written_as_measured(tmp_path):
    """2.8 kg at a hand of 200 g: its links in the file would rather have it heavier and nearer."""

    def arm(name, mass, com):
        last = {"mass": [*dh.UR10.mass[:5], mass], "com": [*dh.UR10.com[:5], com]}
        rotors = [1.8, 1.8, 0.9, 0.2, 0.2, 0.2]
        table = replace(dh.UR10, name=name, rotor_inertia=rotors, **last)
        return load_robot(table.write(tmp_path))

    whole, centre = 3.0, (0.028, 0.019, 0.092)
    nominal, true = arm("light", 0.2, (0.0, 0.0, -0.02)), arm("loaded", whole, centre)
    rng = np.random.default_rng(1)
    time, q, v, vd = course(nominal, rng, 20.0, 100.0)
    tau = inverse_dynamics(true, q, v, vd) + 5 * np.tanh(v / 0.01) + 3 * v
    tau = tau + 0.1 * np.sqrt(np.mean(tau**2, axis=0)) * rng.normal(size=tau.shape)
    recorded = Recorded(Path("tool.csv"), time, {"q": q, "tau": tau})
    found = identify(nominal, [recorded], only="payload", payload="link_6", cutoff=6)
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
    assert not any(one.kind == "inconsistent" for one in found.findings)


def test_poorly_explained_joints_are_named_with_numbers(found):
    eq = found.equations
    free = found.estimate.torque(eq)
    error = np.where(np.arange(len(eq.time)) % 2, 1.0, -1.0) * np.std(eq.tau[eq.fit], axis=0)[1]
    worse = free.copy()
    worse[:, 1] += 0.05 * error
    (one,) = inconsistent(eq, free, worse)
    least = np.std((eq.tau - free)[eq.fit, 1]) / np.std(eq.tau[eq.fit, 1])
    assert one.joints == (2,) and one.evidence["free"] == pytest.approx(least)
    assert one.evidence["consistent"] == pytest.approx(np.hypot(0.05, least), rel=0.02)
    assert re.match(r"joint 2: .* links do not explain 5\.\d % .* \d\.\d %$", one.sentence)


def test_spread_between_recordings_is_pooled_where_a_joint_has_less():
    days = np.array([[[1.0, 0.0], [0.0, 0.0]], [[-1.0, 0.0], [0.0, 0.0]]])
    found = plant._between(days, np.array([[10.0, 1.0], [5.0, 0.0]]))
    one = np.sqrt(2) / 10
    np.testing.assert_allclose(found, [[one, 0], [one / np.sqrt(2), 0]])
    assert not plant._between(days[:1], np.ones((2, 2))).any()


def test_scenario_friction_has_no_damping_and_no_stiff_bristles(tmp_path):
    """Damping of bristles, 5 ms F_c / z_c, over the least inertia: a pole that caps the step."""
    text = re.sub("<damping>.*?<", "<damping>9<", chain_sdf(4, rotor_inertia=1e-4))
    (tmp_path / "chain.sdf").write_text(text)
    chain, coulomb = load_robot(tmp_path / "chain.sdf"), 20.0
    time, q, v, vd = motion(chain, 10.0)
    tau = inverse_dynamics(chain, q, v, vd) + coulomb * np.sign(v)
    found = identify(chain, [Recorded(Path("r.csv"), time, {"q": q, "tau": tau})], only="friction")
    friction = found.plant_friction.friction
    assert np.all(chain.damping == 9) and np.max(friction.viscous) < 0.3
    assert found.equations.nominal == pytest.approx(found.equations.known + 9 * found.equations.v)
    least = torque_groups(chain, q, v, vd).d_kk.min() + chain.reflected_inertia.min()
    assert 0.005 * coulomb / friction.presliding / least == pytest.approx(5000, rel=0.1)


def test_joints_without_slow_motion_get_no_breakaway(robot):
    """At speeds where a Stribeck peak is 0 to the last digit, or next to it."""
    time, q, v, vd = motion(robot)
    fast = np.abs(v).max(axis=0) + np.array([0.05, 0.2, 1.0, 3.0])  # rad/s
    q, v = q + fast * time[:, None], v + fast
    tau = inverse_dynamics(robot, q, v, vd) + COULOMB_TRUE + VISCOUS_TRUE * v
    recorded = Recorded(Path("fast.csv"), time, {"q": q, "tau": tau})
    friction = identify(robot, [recorded], only="friction", cutoff=5).plant_friction.friction
    assert friction.breakaway is None
    np.testing.assert_allclose(friction.viscous, VISCOUS_TRUE, rtol=0.05)
    v = np.linspace(0.5, 3.0, 200)
    rounded = 60 + 16 * v + 1e-9 * (v == v[0])  # the slowest speed alone sees anything of a peak
    for peak in (0.01, 0.05, 0.1):  # there 0, 1e-20, 1e-5 of its height
        (_, _, stribeck), _ = plant._nearest(v, rounded, peak)
        assert stribeck == 0


def test_a_joint_has_a_stribeck_speed_of_its_own_where_that_of_all_leaves_friction(robot):
    """The peak of the last joint is at another speed than those of the others."""
    time, q, v, vd = motion(robot)
    slow = [0.02, 0.02, 0.02, 0.3]
    true = Friction(COULOMB_TRUE, VISCOUS_TRUE, 1.5 * COULOMB_TRUE, stribeck_speeds=slow)
    tau = inverse_dynamics(robot, q, v, vd) + sliding_friction(friction_parameters(true, 4), v)
    recorded = Recorded(Path("peaks.csv"), time, {"q": q, "tau": tau})
    found = identify(robot, [recorded], only="friction", cutoff=10)
    friction = found.plant_friction.friction
    *others, last = friction.stribeck_speeds
    assert max(others) < 0.05 and 0.15 < last < 0.6
    (left,) = found.left(found.written, held_out=True)[3:]
    assert left < 0.01
    judged = judge(robot, [recorded], friction=friction, cutoff=10).left
    assert judged[3] == pytest.approx(left, rel=0.5)


def rubbed(recorded, share):
    """The recording on a day on which all friction is so much more than the true one."""
    v = np.gradient(recorded.signals["q"], recorded.time, axis=0)
    more = share * (COULOMB_TRUE * np.sign(v) + VISCOUS_TRUE * v)
    return changed(recorded, tau=recorded.signals["tau"] + more)


def test_friction_of_another_recording_lies_within_its_interval(robot, true):
    """Two recordings, with a fifth less and more; one alone has the interval of its own day."""
    days = [rubbed(recorded_of(true, seed=i), share) for i, share in enumerate((-0.2, 0.2))]
    alone, both = (identify(robot, days[:n], cutoff=5).plant_friction for n in (1, 2))
    wanted = np.array([COULOMB_TRUE, VISCOUS_TRUE])
    both_ = ((x, [x.friction.coulomb, x.friction.viscous]) for x in (alone, both))
    off = [np.abs(values - wanted) / files.std for files, values in both_]
    assert np.mean(off[0] < 1.96) < 0.5 and np.all(off[1] < 1.96)
    assert np.all(alone.between == 0)
    assert np.all((both.between > 0.15) & (both.between < 0.8))
    values = np.array([both.friction.coulomb, both.friction.viscous])
    assert np.all(both.std < wanted) and np.all(both.std >= both.between * values)


def test_recording_validated_on_itself_is_named(robot, true):
    _, q, _, _ = motion(true, 10.0)
    q = (q - q.mean(axis=0)) * np.hanning(len(q))[:, None]
    v = np.gradient(q, 0.01, axis=0)
    tau = inverse_dynamics(true, q, v, np.gradient(v, 0.01, axis=0)) + 30 * np.tanh(v / 0.01)
    for more, expected in ((0, False), (len(q) // 2, True)):
        rows = np.r_[: len(q), :more]
        time = 0.01 * np.arange(len(rows))
        recorded = Recorded(Path("r.csv"), time, {"q": q[rows], "tau": tau[rows]})
        notes = identify(robot, [recorded], cutoff=5.0, only="friction").notes
        assert any("repeat the fitted motion" in line for line in notes) == expected


def test_recorded_motion_is_slowed_to_the_limits(found, true):
    inf = np.full(true.n, np.inf)
    limits = {"velocity_limit": inf, "acceleration_limit": inf, "effort_limit": inf}
    strong = replace(true, envelope=None, **limits)
    motion, notes = recorded_motion(found, strong, 0.005)
    assert notes == [] and motion.duration == pytest.approx(20, abs=0.1)
    few = replace(strong, velocity_limit=0.5 * np.abs(motion.v).max(axis=0))
    slow, (note,) = recorded_motion(found, few, 0.005)
    assert re.search(r"2\.\d* times slower", note)
    assert np.all(np.abs(slow.v).max(axis=0) < few.velocity_limit)
    np.testing.assert_allclose(slow.q[-1], motion.q[-1], atol=0.01)
    standing = np.abs(inverse_dynamics(true, motion.q, 0 * motion.v, 0 * motion.v)).max(axis=0)
    _, notes = recorded_motion(found, replace(strong, effort_limit=0.5 * standing), 0.005)
    assert "joint 2 'roll' needs" in " ".join(notes) and "raise <effort>" in notes[0]


def test_prior_uncertainty_is_independent_of_link_frame(robot, found):
    """It is that of symmetric S whose distribution no rotation changes: half the variance off the
    diagonal. So any other root of a pseudo-inertia than Cholesky's gives the same."""
    A, columns = found.unknown.base.combination, found.unknown.columns
    order = list(links_by_name(parse_xml(robot.sdf, robot.path)))
    nothing = found.estimate.covariance.copy()
    nothing[: len(A), : len(A)] = 1e16 * np.eye(len(A))  # nothing was measured
    estimate = replace(found.estimate, covariance=nothing)
    S = directions(replace(found, estimate=estimate), robot)
    variance = 0.25 * np.diag([1.0 if i == j else 0.5 for i, j in SYMMETRIC])
    drawn, prior = np.zeros((len(A), len(S))), np.zeros((len(A), len(A)))
    for link in links_of(robot):
        if link.name in [one.name for one in found.consistent.links]:
            placed = link.to_link @ link.pseudo @ link.to_link.T
            ours, other = (
                A @ effect_of(robot, link, np.linalg.solve(link.to_link, root))[columns]
                for root in (np.linalg.cholesky(placed), sqrtm(placed).real)
            )
            at = 10 * order.index(link.name)
            drawn += ours @ S[:, at : at + 10].T
            prior += other @ variance @ other.T
    np.testing.assert_allclose(drawn @ drawn.T, prior, rtol=1e-6, atol=1e-6 * prior.max())
