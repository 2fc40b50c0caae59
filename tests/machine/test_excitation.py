"""Exciting motions of two links in a plane: within limits, and as good as they say."""

import numpy as np
import pytest
from command_line import ARM

from sdt_drake.cli.app import main
from sdt_drake.machine.identify.excitation import _SEARCH, GENTLY, RATE, excite
from sdt_drake.machine.identify.limits import Limits, assumed
from sdt_drake.machine.identify.targets import Target
from sdt_drake.motion import Motion, load_plan, plan_motion
from sdt_drake.motion.command import command_of
from sdt_drake.robot.robot import load_robot


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.sdf"
    limit = "</velocity><drake:acceleration>50</drake:acceleration>"
    path.write_text(ARM.replace("</velocity>", limit, 1))  # of the first joint alone
    return load_robot(path)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Searches like those for many joints; `excitation` is made before."""
    monkeypatch.setitem(_SEARCH, True, _SEARCH[False])


@pytest.fixture(scope="module")
def excitation(arm):
    return excite(Target.everything(arm), 20.0)


def planned(excitation) -> Motion:
    robot = excitation.target.robot
    plan = plan_motion(robot, command_of(excitation.profile, robot))
    assert not plan.limited.any()
    return plan.motion


def test_the_planner_takes_it_as_it_is_and_it_uses_what_it_may(arm, excitation):
    motion = planned(excitation)
    assert motion.duration == 20
    assert np.abs(motion.v[[0, -1]]).max() < 1e-9
    assert np.abs(motion.vd[0]).max() < 0.05 * np.abs(motion.vd).max()
    again = round(1 / excitation.base_frequency / motion.period)
    fitted, judged = np.split(motion.v, [round(excitation.fitted / motion.period)])
    assert fitted[again:] == pytest.approx(fitted[:-again], abs=1e-6)
    # What comes then is another motion from the same place, within the same limits.
    assert len(judged) == again + 1 and np.abs(judged - motion.v[: again + 1]).max() > 0.5
    assert motion.q[-1] == pytest.approx(motion.q[0], abs=1e-6)
    assert np.abs(judged).max() > 0.5 * np.abs(fitted).max()
    assert np.abs(motion.v).max(axis=0) == pytest.approx(5 * excitation.used["speed"], rel=1e-3)
    first, second = excitation.used["acceleration"]
    assert 0 < first <= 0.8 + 1e-6 and 0 < second <= 0.8 + 1e-6
    assert 0.7 < max(share.max() for share in excitation.used.values()) <= 0.8 + 1e-6


def test_the_standard_deviations_are_those_of_fits_to_noise(arm, excitation):
    """Of 300 recordings with torques of noise alone, solved by numpy."""
    motion, target = planned(excitation), excitation.target
    every = round(1 / RATE / motion.period)
    samples = slice(0, round(excitation.fitted / motion.period), every)
    # `rows` are checked against Drake where the regressor is; the noise is put back.
    columns, _ = target.rows(motion.q[samples], motion.v[samples], motion.vd[samples])
    X = columns.reshape(-1, columns.shape[2])
    noise = np.random.default_rng(3).normal(size=(len(X), 300))
    found = np.linalg.lstsq(X, noise, rcond=None)[0]
    assert found.std(axis=1) == pytest.approx(excitation.sigma, rel=0.15)
    assert target.noise == pytest.approx([1, 1])
    scaled = X / np.linalg.norm(X, axis=0)
    assert np.linalg.cond(scaled) == pytest.approx(excitation.condition, rel=0.02)


def test_it_tells_more_than_chance(arm, excitation):
    """Than 200 motions of a frequency for each joint, within the same limits."""
    target, rng = excitation.target, np.random.default_rng(0)

    def information(q, v, vd):
        columns, torque = target.rows(q, v, vd)
        X = columns.reshape(-1, columns.shape[2])
        is_within = np.abs(torque).max() < 81 and np.abs(q).max() < 0.81 * np.pi
        return np.linalg.slogdet(X.T @ X / len(X))[1] if is_within else -np.inf

    t = np.arange(0, 20, 0.1)[:, None]
    by_chance = []
    for _ in range(200):
        omega, phase = rng.uniform(0.5, 3, 2), rng.uniform(0, 6, 2)
        size = np.minimum(2.0, 4 / omega)
        middle = rng.uniform(-0.5, 0.5, 2)
        q, v = middle + size * np.sin(omega * t + phase), size * omega * np.cos(omega * t + phase)
        by_chance.append(information(q, v, -(omega**2) * (q - middle)))
    motion = planned(excitation)
    best = max(by_chance)
    assert information(motion.q, motion.v, motion.vd) > best + 1 > 0


def test_a_payload_is_excited_gently(arm, tmp_path, capsys):
    out = tmp_path / "excite.yaml"
    arguments = ["excite", str(arm.path), "--payload", "lower", "--duration", "10"]
    assert main([*arguments, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "hx of lower [kg m]" in said and "friction" not in said
    assert "first moments hx, hy, hz (mass times" in said
    plan = load_plan(out, arm, period=0.005)
    assert not plan.limited.any()
    assert np.abs(plan.motion.v).max() <= 0.8 * GENTLY * 5 + 1e-6


def test_what_a_file_does_not_limit_is_assumed_and_told(arm, capsys):
    """Of the second joint: what its motor gives the least inertia about it."""
    accelerations, *_ = assumed(arm)
    highest = Limits.of(arm, 1.0).acceleration
    plant = arm.plant
    M = plant.CalcMassMatrix(plant.CreateDefaultContext())
    assert highest == pytest.approx([50, arm.effort_limit[1] / M[1, 1]])
    assert f"limited to 50, {highest[1]:.3g} rad/s²" in accelerations
    assert Limits.of(arm, 0.5, acceleration=[8, 4]).acceleration == pytest.approx([4, 2])
    options = ["--acceleration", "8", "4", "--duration", "5"]
    assert main(["excite", str(arm.path), *options]) == 0
    said = capsys.readouterr().out
    assert "accelerations are limited" not in said and "from " not in said.split("\n")[1]
    assert main(["excite", str(arm.path), "--acceleration", "8"]) == 2
    assert "acceleration: [8.0], expected a list of 2 finite" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--payload hand", "no moving link 'hand', expected one of upper; lower"),
        ("--margin 1.2", '"1.2" for --margin. Expected a number > 0 and <= 1'),
        ("--margin 0.2", "joint 1 exceeds its torque limit even at rest"),
        ("--noise 0", '"0.0" for --noise. Expected a number > 0 and <= 1'),
        ("--duration nan", '"nan" for --duration. Expected a number >= 1'),
        ("--duration 12.3456", "--duration: 12.3456 s is not a whole multiple of the period 0.005"),
        ("--out x.csv", "x.csv: unknown kind of file, expected .yaml"),
    ],
)
def test_what_cannot_be_is_refused(arm, options, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["excite", str(arm.path), *options.split()]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
