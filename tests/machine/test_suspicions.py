"""What is said of recordings that are read otherwise than they are; the truth is known."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers import simulated_recordings as simulated
from helpers.faults import blames, names, recording
from helpers.known_truth import changed
from helpers.more_faults import with_tool
from oracles.dh import DATA, KUKA_KR300, UR10, needs_data

from sdt_drake.io.errors import InputError
from sdt_drake.machine.diagnose.finding import kinds
from sdt_drake.machine.diagnose.readings import misread
from sdt_drake.machine.diagnose.recording import check_recording
from sdt_drake.machine.diagnose.residual import Delay, delay_of
from sdt_drake.machine.diagnose.units import _sizes, torque_unit
from sdt_drake.machine.identify.base_parameters import Unknown
from sdt_drake.machine.identify.equations import equations
from sdt_drake.machine.identify.judge import judge
from sdt_drake.machine.identify.procedure import identify, parts_of
from sdt_drake.machine.recordings.columns import Columns
from sdt_drake.machine.recordings.reading import read_recording
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import load_robot

CUTOFF = 6.0


def said(robot, recorded):
    """What blames a recording."""
    return blames(identify(robot, [recorded], cutoff=CUTOFF))


REMEDIES = {
    "kilo": "torque_factor: [1000, 1000, 1000]",
    "motor_side": "side: motor",
    "amperes": "",
    "per_mille": "",
    "swapped": "tau: in the order [1, 3, 2]",
    "reversed_order": "q and tau: in the order of the joints, base to tip",
    "shuffled": "q, v and tau: in the order [2, 3, 1]",
    "shuffled_torques": "tau: in the order [2, 3, 1]",
    "shuffled_positions": "q and v: in the order [2, 3, 1]",
    "torque_sign": "torque_factor: [1, 1, -1]",
    "direction": "direction: [1, 1, -1]",
    "zero": "position_offset: [0, -1.5708, 0]",
    "wall": "",
    "all_signs": "torque_factor: [-1, -1, -1]",
    "zero_10": "position_offset: [0, ",
    "coupled_motors": "",
    "swapped_at_wrist": "tau: in the order [1, 3, 2]",
    "turns": "angle: turn",
    "torque_late": "torque_delay: 0.01",
    "torque_of_one_late": "",
    "hysteresis": "",
    "spring": "",
    "drift": "",
}


ALIKE = {
    "amperes", "per_mille", "reversed_order", "shuffled", "shuffled_positions", "direction", "wall",
    "zero_10", "swapped_at_wrist", "torque_of_one_late",
}  # fmt: skip
"""Faults that are found as others of their kind."""


@pytest.mark.parametrize(
    "fault", [pytest.param(x, marks=[pytest.mark.oracle] * (x in ALIKE)) for x in REMEDIES]
)
def test_fault_is_named_with_remedy_and_evidence(fault):
    robot, recorded = recording("arm3", fault, 4)
    found = said(robot, recorded)
    one = next(one for one in found if names(one, fault))
    assert one.remedy.startswith(REMEDIES[fault]) and bool(one.remedy) == bool(REMEDIES[fault])
    assert all(one.evidence and np.isfinite([*one.evidence.values()]).all() for one in found)
    assert {one.kind for one in found} <= kinds().keys()


def test_percent_are_told_with_factors_of_all_joints_where_each_torque_has_a_likely_size():
    """Of the effort limits, 200, 200 and 90 N m, and of rated torques, 0.4 times as large."""
    robot, recorded = recording("arm3", "", 4)
    for share, words, factor in ((1.0, "the effort limit", 2.0), (0.4, "a rated torque", 0.8)):
        tau = 100 * recorded.signals["tau"] / robot.effort_limit / share
        (one,) = said(robot, replace(recorded, signals=recorded.signals | {"tau": tau}))
        assert one.kind == "unit" and f"percent of {words}" in str(one)
        told = yaml.safe_load(re.search(r"torque_factor\D*(\[.*?\])", str(one))[1])
        assert told == pytest.approx([factor, factor, 0.45 * factor], rel=0.25)


def test_evidence_equals_the_fault_put_in():
    """Torques 12 ms late; torques in kN m."""
    late, *_ = said(*recording("arm3", "torque_late", 4))
    assert late.evidence["delay_s"] == pytest.approx(0.012, abs=4 * late.evidence["error_s"])
    (kilo,) = said(*recording("arm3", "kilo", 4))
    assert kilo.joints == (1, 2, 3)
    assert 5e-4 < kilo.evidence["least_times"] <= kilo.evidence["most_times"] < 2e-3


def equations_of(robot, recorded):
    parts, _ = parts_of([recorded], [], 1 / 3)
    return equations(robot, Unknown.nothing(), parts, CUTOFF)


def test_a_unit_of_one_name_is_written_for_joints_that_do_not_show_it():
    """Of three joints in kN m, the last has noise in place of a torque. Factors of currents that
    nothing shows are left open."""
    truth, rng = simulated.truth("arm3", 4), np.random.default_rng(0)
    tau = truth.recorded.signals["tau"].copy()
    tau[:, 2] = 0.1 * np.std(tau[:, 2]) * rng.normal(size=len(tau))
    for per, expected in ((1e3, "[1000, 1000, 1000]"), (12.0, ", ?]")):
        unit = torque_unit(
            truth.robot, equations_of(truth.robot, changed(truth.recorded, tau=tau / per))
        )
        assert unit.finding.joints == (1, 2) and expected in str(unit.finding)


@pytest.mark.parametrize(("factor", "expected"), [(1.0, []), (1e-3, [(3,)])])
def test_a_unit_of_one_torque_is_told_by_its_friction_where_links_tell_nothing(factor, expected):
    """The last link is so light that its torque is friction alone, as that of a real wrist."""
    table = replace(simulated.ARM, name="light", mass=[12.0, 8.0, 1e-4], rotor_inertia=[0.0] * 3)
    robot = simulated.mounted(table)
    time, q, v, vd = simulated.course(robot, np.random.default_rng(0), 20.0, 100.0)
    rubs = [8.0, 9.0, 3.0] * (np.tanh(v / 0.002) + v / np.abs(v).max(axis=0))
    tau = (inverse_dynamics(robot, q, v, vd) + rubs) * [1.0, 1.0, factor]
    found = said(robot, Recorded(Path("f.csv"), time, {"q": q, "tau": tau}))
    assert [one.joints for one in found if one.kind == "unit"] == expected


@pytest.mark.parametrize("seed", [2, 7])  # wrists with 3 to 6 % of the torque of usual links
def test_another_size_of_a_small_torque_is_no_unit(seed):
    robot, recorded = recording(f"random{seed}", "", seed)
    eq = equations_of(robot, recorded)
    assert np.max(np.abs(_sizes(robot, eq).size)) > np.log(2)
    assert torque_unit(robot, eq) is None


def test_a_payload_is_no_unit(tmp_path):
    """A tool of the arm's own weight at a wrist of 0.2 kg: 40 times the torque of the file."""
    light = replace(simulated.ARM, name="light", mass=[12.0, 8.0, 0.2])
    robot = load_robot(light.write(tmp_path))
    real = deviated(robot, Deviation(payload="link_3", payload_mass=20.0))
    time, q, v, vd = simulated.course(robot, np.random.default_rng(0), 20.0, 100.0)
    recorded = Recorded(Path("p.csv"), time, {"q": q, "tau": inverse_dynamics(real, q, v, vd)})
    found = identify(robot, [recorded], only="payload", payload="link_3", cutoff=CUTOFF)
    assert blames(found) == []
    assert found.left(found.equations.nominal, held_out=True)[2] > 0.9


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("six", 0.2),
        pytest.param("ur10", 0.2, marks=needs_data),
        *(pytest.param(*x, marks=pytest.mark.oracle) for x in (("seven", 0.2), ("cobot", 0.1))),
    ],
)
def test_a_tool_that_the_file_lacks_is_told_with_its_mass_in_place_of_a_unit(name, share):
    """Torques of wrists are 5 to 50 times those of the file, in per cent of their limits or so."""
    robot, recorded = with_tool(name, share)
    eq = equations_of(robot, recorded)
    assert torque_unit(robot, eq) is not None
    (one,) = misread(robot, eq)
    assert one.kind == "payload" and not one.spoils
    more = one.evidence["mass_kg"] / simulated.weight(robot) - share
    assert -0.02 < more < 0.06  # simulated robots carry up to 5 % more


def test_a_unit_and_a_tool_that_are_as_likely_are_both_told():
    """Forty times the torque of a pendulum is that of a body that weighs more on its arm."""
    ones = {name: getattr(simulated.ARM, name)[1:2] for name in
            ("d", "a", "alpha", "theta", "mass", "com", "speed", "effort")}  # fmt: skip
    table = replace(simulated.ARM, name="pendulum", base=(np.pi / 2, 0.0, 0.0), **ones,
                    rotor_inertia=[0.0], gear_ratio=[1.0])  # fmt: skip
    robot = simulated.mounted(table)
    time, q, v, vd = simulated.course(robot, np.random.default_rng(0), 20.0, 100.0)
    tau = 40 * inverse_dynamics(robot, q, v, vd)
    found = misread(robot, equations_of(robot, Recorded(Path("p.csv"), time, {"q": q, "tau": tau})))
    assert [one.kind for one in found] == ["unit", "payload"]


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("cobot", "no_gravity"), ("heavy", "no_gravity"), ("cobot", "zero_10"),
        ("heavy", "zero_10"), ("sdt", "zero_10"), ("cobot", "swapped_at_wrist"),
    ],
)  # fmt: skip
def test_fault_is_named_alone_at_other_robots(name, fault):
    """Zeros of two parallel joints explain as much, so both are told."""
    robot, recorded = recording(name, fault, 100)
    (one,) = misread(robot, equations_of(robot, recorded))
    assert names(one, fault)
    assert ("; or an offset of " in one.sentence) == (name == "heavy" and fault == "zero_10")


@pytest.mark.parametrize("name", ["cobot", pytest.param("kuka", marks=needs_data)])
def test_a_spring_that_links_of_its_joint_alone_would_explain_is_named(name):
    found = said(*recording(name, "spring", 100))
    assert names(found[0], "spring") and found[0].joints == (2,)


def test_links_that_were_taken_from_the_file_are_blamed_before_a_spring():
    robot, recorded = recording("arm3", "", 4)
    found = identify(robot, [recorded], only="friction", cutoff=CUTOFF).findings
    causes = [one.evidence for one in found if one.kind == "residual"]
    assert len(causes) == 3 and all(x["links"] > max(0.95, x["position"]) for x in causes)


@needs_data
def test_torques_of_friction_at_a_real_wrist_tell_their_joints():
    """Where friction is most of the torque: by the speed of which joint it changes its sign."""
    robot, recorded = recording("ur10", "swapped_at_wrist", 0)
    (one,) = misread(robot, equations_of(robot, recorded))
    assert "tau_5 and tau_6 swapped" in one.sentence


@pytest.mark.parametrize("blemish", ["repeated", "frozen_tau", "clipped"])
def test_a_blemish_does_not_hide_the_sign_of_a_torque(blemish):
    truth, rng = simulated.truth("arm3", 4), np.random.default_rng(1)
    truth = replace(truth, recorded=getattr(simulated, blemish)(truth, rng))
    found = said(truth.robot, simulated.torque_sign(truth, rng))
    assert {one.kind for one in found} == {blemish.partition("_")[0], "columns"}


def test_checks_that_are_left_out_are_told():
    robot, recorded = recording("arm3", "degrees", 4)
    assert identify(robot, [recorded], cutoff=CUTOFF).notes[-1] == (
        "units, order and signs of torques, delays of torques, springs, hysteresis and other "
        "forces are not looked for before the warning is heeded (degrees)"
    )
    slow = replace(recorded, time=1e3 * recorded.time)
    with pytest.raises(InputError, match=r"at least 2 Hz; is the time in milliseconds"):
        identify(robot, [slow])


def test_judge_gives_the_findings_of_the_check():
    robot, recorded = recording("arm3", "degrees", 4)
    assert judge(robot, [recorded], cutoff=CUTOFF).findings == tuple(
        check_recording(robot, recorded)
    )


def test_swapped_torques_of_alike_motions_are_not_taken_for_units():
    truth = simulated.truth("arm3", 4, together=True)
    (one,) = said(truth.robot, simulated.swapped(truth, np.random.default_rng(0)))
    assert names(one, "swapped")


def test_clean_simulated_recordings_have_no_finding():
    robot, recorded = recording("arm3", "", 9)
    found = identify(robot, [recorded], cutoff=CUTOFF)
    assert blames(found) == []
    clean = delay_of(found.equations, CUTOFF)
    assert abs(clean.common) < 5e-4 and not clean.is_significant
    late = replace(found.equations, time=found.equations.time + 1)  # a constant is no delay
    assert delay_of(late, CUTOFF).common == pytest.approx(clean.common, abs=1e-6)


def test_a_joint_alone_has_no_other_order():
    """Its friction builds up over an angle at reversals; no delay is told, no order tried."""
    one = replace(
        simulated.ARM, name="one",
        **{name: getattr(simulated.ARM, name)[:1]
           for name in ("d", "a", "alpha", "theta", "mass", "com", "speed", "effort",
                        "rotor_inertia", "gear_ratio")},
    )  # fmt: skip
    robot = simulated.mounted(one)
    time, q, v, vd = simulated.course(robot, np.random.default_rng(0), 20.0, 100.0)
    built = np.zeros(len(q))
    for i in range(1, len(q)):
        built[i] = np.clip(built[i - 1] + (q[i, 0] - q[i - 1, 0]) / 0.05, -1, 1)
    tau = inverse_dynamics(robot, q, v, vd) + 20 * built[:, None]
    found = said(robot, Recorded(Path("d.csv"), time, {"q": q, "tau": tau}))
    assert {one.kind for one in found} <= {"residual", "held out"}


def test_delay_at_the_bound_of_its_search_is_none():
    told = Delay(0.17, 0.001, np.array([0.17]), np.array([0.001]), gain=0.5, most=0.35)
    assert told.is_significant and not replace(told, most=0.175).is_significant


def test_delay_that_explains_less_of_held_out_data_is_none():
    """Torques are 20 ms late, but not in a short part, which is held out."""
    truth = simulated.truth("arm3", 4)
    tau, time = truth.recorded.signals["tau"], truth.recorded.time

    def is_held_out(time):
        return (time > 0.4 * truth.recorded.time[-1]) & (time < 0.46 * truth.recorded.time[-1])

    delayed = simulated.late(tau, time, np.where(is_held_out(time), 0.0, 0.02))
    eq = identify(truth.robot, [changed(truth.recorded, tau=delayed)], cutoff=CUTOFF).equations
    whole, parts = (replace(eq, fit=x) for x in (eq.time > 0, ~is_held_out(eq.time)))
    assert delay_of(whole, CUTOFF).is_significant and not delay_of(parts, CUTOFF).is_significant


@needs_data
def test_published_recordings_raise_no_false_finding(tmp_path):
    robot = load_robot(UR10.write(tmp_path))
    assert said(robot, read_recording(DATA / "ur10/exciting.csv", robot)) == []
    robot = load_robot(KUKA_KR300.write(tmp_path))
    columns = Columns(q=["q_motor_{k}"], tau=["motor_torque_{k}"], side="motor", v=[])
    for name in "AB":
        path = DATA / f"kuka_kr300/recording_{name}.csv"
        (one,) = said(robot, read_recording(path, robot, columns))  # 10 s excite little
        assert one.kind == "held out" and "drift, wear or another payload" in one.sentence
