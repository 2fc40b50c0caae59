"""Acceptance tests: motions within limits, and what was put into devices and recordings found."""

import numpy as np
import pytest
from helpers.robots import ARM
from scipy.interpolate import CubicSpline

import sdt_drake as sdt
from sdt_drake.io.errors import InputError
from sdt_drake.machine.accept.plan import scenario_of
from sdt_drake.machine.accept.spec import Acceptance

INERTIA, RADIUS = 4.0, 0.2
TURNTABLE = f"""
<sdf version="1.9" xmlns:drake="drake.mit.edu"><model name="turntable">
<link name="cabin"><inertial><mass>10</mass><inertia><ixx>{INERTIA}</ixx><iyy>{INERTIA}</iyy>
<izz>{INERTIA}</izz></inertia></inertial></link>
<frame name="head" attached_to="cabin"><pose>{RADIUS} 0 0 0 0 0</pose></frame>
<joint name="turn" type="revolute"><parent>world</parent><child>cabin</child>
<axis><xyz>0 0 1</xyz><limit><lower>-2</lower><upper>2</upper><effort>200</effort>
<velocity>4</velocity></limit></axis><drake:gear_ratio>10</drake:gear_ratio></joint>
</model></sdf>
"""
SHORT = Acceptance(
    frequencies=[1, 4], cycles=3, steps=[0.01, 1], repeats=3, chain=[2.0], excursion_speed=0.5,
    hysteresis_period=2, dwell=0.2,
)  # fmt: skip


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("turntable") / "turntable.sdf"
    path.write_text(TURNTABLE, encoding="utf-8")
    controller = {"kind": "p_pi", "omega_r": 60.0, "zeta": [1.0]}
    return sdt.load("training", {"name": "turntable", "robot": str(path), "controller": controller})


@pytest.fixture(scope="module")
def plan(scenario):
    return sdt.accept_plan(scenario, SHORT)


@pytest.fixture(scope="module")
def predicted(scenario):
    return numbers(sdt.accept_predict(scenario, SHORT))


def numbers(accepted):
    """Characteristics by kind, quantity, and frequency [Hz] or size; those of the head by place."""
    return {
        (*([x.place.split(",")[0]] if x.place.startswith("head ") else []), x.kind, x.quantity)
        + (() if np.isnan(x.at) else (round(x.at, 3),)): x
        for x in accepted.characteristics
    }


# --- motions -------------------------------------------------------------------------------------


def test_motions_take_their_share_of_each_limit_and_no_more(plan):
    for one in plan.motions:
        motion, torque = one.motion, INERTIA * one.motion.vd
        assert np.abs(motion.q).max() <= 0.95 * 2 + 1e-9
        assert np.abs(motion.v).max() <= 0.501 * 4
        assert np.abs(torque).max() <= 0.801 * 200
        assert not motion.v[[0, -1]].any()
    motion, tests = plan.motions[0].motion, plan.motions[0].tests.tests
    assert [test.kind for test in tests] == [
        "excursion", "speed", "sine", "sine", "hysteresis", "hysteresis", "step", "step"
    ]  # fmt: skip
    assert np.abs(motion.q).max() == pytest.approx(1.9, rel=0.01)
    assert np.abs(motion.v).max() == pytest.approx(2.0, rel=0.01)


def test_steps_and_sines_have_the_sizes_and_times_of_the_manifest(plan):
    motion = plan.motions[0].motion
    for test in plan.motions[0].tests.tests:
        inside = (motion.time >= test.start - 1e-9) & (motion.time < test.end - 1e-9)
        if test.kind == "sine":
            expected = test.size * np.sin(2 * np.pi * (motion.time - test.start) * test.frequency)
            assert motion.q[inside, 0] == pytest.approx(expected[inside], abs=1e-2 * test.size)
        if test.kind == "step":
            assert np.abs(motion.vd[inside]).max() == pytest.approx(test.size, rel=0.01)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"frequencies": [1, 30]}, "sine at 30 Hz: the period of the set points allows 20 Hz"),
        ({"least_amplitude_deg": 30}, "sine at 4 Hz: the limits allow 2.3 deg"),
    ],
)
def test_a_frequency_beyond_the_device_is_left_out_and_said(scenario, changes, text):
    plan = sdt.accept_plan(scenario, SHORT.changed(changes))
    assert any(text in line for line in plan.left_out), plan.left_out


def test_a_joint_without_stops_and_an_arm_too_weak_for_its_weight_say_so(tmp_path):
    path = tmp_path / "arm.sdf"
    path.write_text(ARM, encoding="utf-8")
    plan = sdt.accept_plan(scenario_of(path), SHORT)
    assert "2 elbow, excursion: the joint has no stops" in plan.left_out
    path.write_text(ARM.replace(">90<", ">45<"), encoding="utf-8")  # 41 N m of gravity
    with pytest.raises(InputError, match=r"arm.sdf: none of the tests is possible: 1 shoulder"):
        sdt.accept_plan(scenario_of(path), SHORT)


def test_channels_are_driven_alone_by_the_joints_that_can():
    plan = sdt.accept_plan(sdt.load("training"), SHORT.changed({"frequencies": [1], "repeats": 3}))
    chain = next(x for x in plan.motions if x.tests.name == "chain")
    assert [x.channel for x in chain.tests.tests] == ["surge", "roll", "pitch", "yaw"]
    assert "chain, heave: the joints do not drive it" in plan.left_out


# --- what is in a device -------------------------------------------------------------------------


def test_describing_functions_are_those_of_bode(scenario, predicted):
    still = sdt.Motion.from_speeds(0.005, np.zeros(1), np.zeros((5, 1)))
    response = sdt.bode(sdt.design(scenario, motion=still), at_rest=True)
    tracking = CubicSpline(response.omega, response.tracking[:, 0])
    for f in (1.0, 4.0):
        expected, omega = complex(tracking(2 * np.pi * f)), 2 * np.pi * f
        gain, phase = (predicted["sine", name, f].value for name in ("gain", "phase"))
        assert gain == pytest.approx(20 * np.log10(abs(expected)), abs=0.01)
        assert phase == pytest.approx(np.angle(expected), abs=2e-4 * omega)
        assert predicted["sine", "noise", f].high < 1e-3


def test_a_device_reaches_its_excursions_speed_and_steps(predicted):
    assert predicted["excursion", "highest"].value == pytest.approx(1.9, abs=0.02)
    assert predicted["excursion", "lowest"].value == pytest.approx(-1.9, abs=0.02)
    assert predicted["speed", "speed"].value == pytest.approx(2.0, rel=0.02)
    assert abs(predicted["hysteresis", "hysteresis"].value) < 2e-4  # fast reversals
    assert predicted["poses", "path_repeatability"].high < 1e-5


def test_the_head_moves_as_the_joint_on_its_radius(predicted):
    for f in (1.0, 4.0):
        for quantity in ("gain", "phase"):
            own = predicted["sine", quantity, f].value
            for channel in ("head yaw", "head sway"):
                at_head = predicted[channel, "sine", quantity, f].value
                assert at_head == pytest.approx(own, abs=0.02), (channel, quantity, f)
    omega = 2.0
    assert predicted["chain", "gain", round(omega / 2 / np.pi, 3)].value == pytest.approx(
        0, abs=0.1
    )


def test_a_delay_is_found_in_phases_and_thresholds(scenario, predicted):
    delay = 0.02
    found = numbers(sdt.accept_predict(scenario.changed({"drive.reference_delay": delay}), SHORT))
    for key, x in found.items():
        if key[:2] == ("sine", "phase"):
            expected = predicted[key].value - 2 * np.pi * x.at * delay
            assert x.value == pytest.approx(expected, abs=1e-4)
        if key[:2] == ("step", "threshold"):
            assert x.value == pytest.approx(predicted[key].value + delay, abs=1e-4)
