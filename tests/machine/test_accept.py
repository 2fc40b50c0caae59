"""Acceptance tests: motions within limits, and what was put into devices and recordings found."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.robots import ARM
from scipy.interpolate import CubicSpline

import sdt_drake as sdt
from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import read_table, write_table
from sdt_drake.machine.accept.plan import scenario_of, write_plan
from sdt_drake.machine.accept.results import Characteristic
from sdt_drake.machine.accept.spec import Acceptance, AcceptanceLimits, Manifest
from sdt_drake.machine.recordings.columns import Columns

INERTIA, ROTOR, RATIO, RADIUS = 4.0, 0.02, 10, 0.2
TURNTABLE = f"""
<sdf version="1.9" xmlns:drake="drake.mit.edu"><model name="turntable">
<link name="cabin"><inertial><mass>10</mass><inertia><ixx>{INERTIA}</ixx><iyy>{INERTIA}</iyy>
<izz>{INERTIA}</izz></inertia></inertial></link>
<frame name="head" attached_to="cabin"><pose>{RADIUS} 0 0 0 0 0</pose></frame>
<joint name="turn" type="revolute"><parent>world</parent><child>cabin</child>
<axis><xyz>0 0 1</xyz><limit><lower>-2</lower><upper>2</upper><effort>200</effort>
<velocity>4</velocity></limit></axis><drake:rotor_inertia>{ROTOR}</drake:rotor_inertia>
<drake:gear_ratio>{RATIO}</drake:gear_ratio></joint>
</model></sdf>
"""
SHORT = Acceptance(
    frequencies=[1, 4], cycles=3, steps=[0.01, 1], repeats=3, chain=[2.0], excursion_speed=0.5,
    hysteresis_period=2, dwell=0.2,
)  # fmt: skip
FEW = SHORT.changed({"frequencies": [4], "chain": [], "excursion_speed": 1.0, "dwell": 0.05})

REST = sdt.Motion.from_speeds(0.005, np.zeros(1), np.zeros((5, 1)))


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
        motion, torque = one.motion, (INERTIA + ROTOR * RATIO**2) * one.motion.vd
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
        ({"least_amplitude_deg": 30}, "sine at 4 Hz: the limits allow 1.5 deg"),
    ],
)
def test_a_frequency_beyond_the_device_is_left_out_and_said(scenario, changes, text):
    plan = sdt.accept_plan(scenario, SHORT.changed(changes))
    assert any(text in line for line in plan.left_out), plan.left_out


def test_a_joint_without_stops_and_an_arm_too_weak_for_its_weight_say_so(tmp_path):
    path = tmp_path / "arm.sdf"
    path.write_text(ARM, encoding="utf-8")
    plan = sdt.accept_plan(scenario_of(path), FEW)
    assert "2 elbow, excursion: the joint has no stops" in plan.left_out
    path.write_text(ARM.replace(">90<", ">45<"), encoding="utf-8")  # 41 N m of gravity
    with pytest.raises(InputError, match=r"arm.sdf: none of the tests is possible: 1 shoulder"):
        sdt.accept_plan(scenario_of(path), FEW)


def test_channels_are_driven_alone_by_the_joints_that_can():
    plan = sdt.accept_plan(sdt.load("training"), FEW.changed({"chain": [2.0]}))
    chain = [x.tests for x in plan.motions if x.tests.name.startswith("chain")]
    assert [x.name for x in chain] == ["chain_surge", "chain_roll", "chain_pitch", "chain_yaw"]
    assert [x.tests[0].channel for x in chain] == ["surge", "roll", "pitch", "yaw"]
    assert "chain, heave: the joints do not drive it" in plan.left_out


# --- what is in a device -------------------------------------------------------------------------


def test_describing_functions_are_those_of_bode(scenario, predicted):
    response = sdt.bode(sdt.design(scenario, motion=REST), at_rest=True)
    tracking = CubicSpline(response.omega, response.tracking[:, 0])
    for f in (1.0, 4.0):
        expected, omega = complex(tracking(2 * np.pi * f)), 2 * np.pi * f
        gain, phase = (predicted["sine", name, f].value for name in ("gain", "phase"))
        assert gain == pytest.approx(20 * np.log10(abs(expected)), abs=0.01)
        # Set points are held: 0.12 ms at a period of 5 ms, 0.03 ms at 2.5 ms.
        assert phase == pytest.approx(np.angle(expected), abs=1.5e-4 * omega)
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
    assert predicted["chain", "gain", round(1 / np.pi, 3)].value == pytest.approx(0, abs=0.1)


@pytest.mark.oracle
def test_a_delay_is_found_in_phases_and_thresholds(scenario, predicted):
    delay = 0.02
    found = numbers(sdt.accept_predict(scenario.changed({"drive.reference_delay": delay}), FEW))
    for key, x in found.items():
        if key[:2] == ("sine", "phase"):
            expected = predicted[key].value - 2 * np.pi * x.at * delay
            assert x.value == pytest.approx(expected, abs=1e-4)
        if key[:2] == ("step", "threshold"):
            assert x.value == pytest.approx(predicted[key].value + delay, abs=1e-4)


@pytest.mark.oracle
def test_threshold_is_the_time_in_which_the_integrator_breaks_the_joint_loose(scenario):
    """The speed error of a stuck joint is a t, so the torque grows by r² K_IS a t² / 2.

    It has to go from the friction of the motion before to that of the other direction, 2 F.
    """
    friction = 2.0
    controller = {"kind": "pi", "setpoint_weight": 0.0, "omega_r": 60.0, "zeta": [1.0]}
    stuck = scenario.changed({"controller": controller, "plant.friction": {"coulomb": [friction]}})
    spec = FEW.changed({"steps": [0.002, 0.008, 0.032]})
    found = numbers(sdt.accept_predict(stuck, spec))
    ki = float(sdt.design(stuck, motion=REST).tuning.gains.ki[0])
    steps = [x for key, x in found.items() if key[:2] == ("step", "threshold")]
    assert len(steps) == 3
    for x in steps:
        loose = np.sqrt(4 * friction / (RATIO**2 * ki * x.at))
        assert loose < x.value < loose + 0.015


@pytest.mark.oracle
def test_hysteresis_is_the_play_and_the_stretch_by_friction(scenario):
    """A link behind a spring k with a play b is b / 2 + F / k behind its motor, either way."""
    play, friction, omega = 0.01, 4.0, 60.0
    elasticity = {"natural_frequency": [omega], "damping_ratio": 0.1, "backlash": [play]}
    changes = {"plant.friction": {"coulomb": [friction]}, "plant.elasticity": elasticity}
    spec = FEW.changed({"steps": [0.1], "step_time": 0.2})
    found = numbers(sdt.accept_predict(scenario.changed(changes | {"accuracy": 1e-3}), spec))
    expected = play + 2 * friction / (omega**2 * INERTIA)
    assert found["hysteresis", "hysteresis"].value == pytest.approx(expected, rel=0.01)


# --- what is in a recording ----------------------------------------------------------------------

GAIN, LATE, NOISE, RATE, BEFORE = 0.9, 0.0125, 1e-5, 400.0, 1.25


def record(one, path, **changes):
    """Write a recording of a made-up machine, in degrees: a gain, a delay, noise of the encoder."""
    motion = one.motion
    time = np.arange(0, motion.duration + 2 * BEFORE, 1 / RATE)
    curve = CubicSpline(motion.time, motion.q)

    def at(since):
        return curve(np.clip(since, 0, motion.duration))

    noise = np.random.default_rng(0).normal(0, NOISE, (len(time), motion.n))
    signals = {"q": GAIN * at(time - BEFORE - LATE) + noise, "q_ref": at(time - BEFORE)}
    kept = changes.pop("kept", np.ones(len(time), dtype=bool))
    signals |= {k: change(time, signals) for k, change in changes.items()}
    columns = {k: np.degrees(x[kept]) if k != "tau" else x[kept] for k, x in signals.items()}
    write_table(path, time[kept], columns)
    return path


@pytest.fixture(scope="module")
def folder(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("accept") / "planned"
    limits = AcceptanceLimits(gain_db=1, phase_deg=10, up_to=2, threshold=0.0125, noise=0.1)
    write_plan(replace(plan, spec=plan.spec.changed({"limits": limits})), folder)
    return folder


def test_recordings_show_the_gain_delay_and_noise_of_their_machine(plan, folder, tmp_path):
    paths = [record(one, tmp_path / f"{i}.csv") for i, one in enumerate(plan.motions[::-1])]
    accepted = sdt.accept_judge(folder, paths, columns=Columns(angle="deg"))
    found, band = numbers(accepted), plan.spec.band
    f = np.fft.rfftfreq(4000, 1 / RATE)
    white = np.mean(((2 * np.pi * f) ** 2 * 2 ** (-((f / band) ** 2) / 2)) ** 2)
    sizes = {x.frequency: x.size for x in plan.motions[0].tests.tests if x.kind == "sine"}
    for at, size in sizes.items():
        omega = 2 * np.pi * at
        assert found["sine", "gain", at].value == pytest.approx(20 * np.log10(GAIN), abs=0.01)
        assert found["sine", "phase", at].value == pytest.approx(-omega * LATE, abs=1e-3)
        noise = found["sine", "noise", at]
        amplitude = GAIN * size * omega**2 * 2 ** (-((at / band) ** 2) / 2)
        expected = np.sqrt(2 * white) * NOISE / amplitude
        assert noise.value == pytest.approx(expected, rel=0.2)
        assert noise.low <= expected <= noise.high
    key = next(key for key, x in found.items() if key[:2] == ("step", "threshold") and x.at > 1)
    rise = 0.02 * np.sqrt(2 * np.log(2)) / band  # of the filter, see below
    assert found[key].value == pytest.approx(LATE, abs=0.003 + rise)
    assert found["excursion", "highest"].value == pytest.approx(GAIN * 1.9, rel=0.01)
    width = 2 * (GAIN - 1) * 0  # a gain and a delay are no hysteresis
    assert found["hysteresis", "hysteresis"].value == pytest.approx(width, abs=2e-5)
    verdicts = {key: x.verdict for key, x in found.items()}
    assert verdicts["sine", "gain", 1.0] == "pass" and verdicts["sine", "gain", 4.0] == ""
    assert {"pass", ""} < {*verdicts.values()}


FAULTS = {
    "contains -1.250 to 20.": {"kept": lambda t: t < 21.5},
    "deg from the nearest planned motion": {"q_ref": lambda t, s: -s["q_ref"]},
    "recorded at 100 Hz, accelerations up to 40 Hz (band) need at least 160 Hz": {
        "kept": lambda t: np.arange(len(t)) % 4 == 0
    },
    "1 gap(s) in time, the longest 0.1": {"kept": lambda t: (t < 20) | (t > 20.1)},
    "joint 1 'turn' is at its torque limit at": {
        "tau": lambda t, s: np.full((len(t), 1), 199.0) * (np.abs(s["q"]) > 0.05)
    },
}


@pytest.mark.parametrize("text", FAULTS)
def test_a_recording_that_shows_nothing_is_refused(plan, folder, tmp_path, text):
    changes = dict(FAULTS[text])
    if "kept" in changes:
        time = np.arange(0, plan.motions[0].motion.duration + 2 * BEFORE, 1 / RATE)
        changes["kept"] = changes["kept"](time)
    path = record(plan.motions[0], tmp_path / "bad.csv", **changes)
    with pytest.raises(InputError) as error:
        sdt.accept_judge(folder, path, columns=Columns(angle="deg"))
    assert str(path) in str(error.value) and text in str(error.value)


def test_two_recordings_of_one_motion_and_none_are_refused(plan, folder, tmp_path):
    one = record(plan.motions[1], tmp_path / "one.csv")
    two = record(plan.motions[1], tmp_path / "two.csv", q=lambda t, s: 0.99 * s["q"])
    degrees = Columns(angle="deg")
    with pytest.raises(InputError, match=r"two.csv: is a recording of poses, as .*one.csv"):
        sdt.accept_judge(folder, [one, two], columns=degrees)
    with pytest.raises(InputError, match="recordings: none given"):
        sdt.accept_judge(folder, [])
    accepted = sdt.accept_judge(folder, one, columns=degrees)
    assert "joint_1: not recorded" in accepted.left_out
    assert "No limits" in str(accepted) or accepted.counts["fail"] == 0


def test_a_manifest_names_each_motion_once():
    test = {"kind": "sine", "size": 1.0, "start": 0.0, "cycle": 1.0, "cycles": 2}
    with pytest.raises(InputError, match=r"motions\[2\].name: a is given twice"):
        Manifest(motions=[{"name": "a", "tests": [test]}] * 2)


def test_drives_get_the_files_of_export_for_each_motion(plan, tmp_path):
    drives = "cycle_time: 0.005\naxes: [{increments: 65536, rated_torque: 20, objects: [607Ah]}]\n"
    (tmp_path / "drives.yaml").write_text(drives, encoding="utf-8")
    one = plan.motions[1]
    write_plan(replace(plan, motions=(one,)), tmp_path / "out", tmp_path / "drives.yaml")
    _, columns = read_table(tmp_path / "out/poses/motion.csv")
    points = np.loadtxt(tmp_path / "out/poses/set_points.csv", delimiter=",", skiprows=1)
    turns = columns["q_ref"][:, 0] * RATIO / (2 * np.pi)
    assert points[:, 1] == pytest.approx(65536 * turns, abs=0.51)


# --- limits --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [(0.1, 0.9, "pass"), (1.1, 1.2, "fail"), (0.9, 1.1, "not judged"), (-2, -1.5, "fail")],
)
def test_a_number_is_judged_by_its_whole_interval(low, high, verdict):
    x = Characteristic("sine", "1", 1, "gain", 1.0, (low + high) / 2, low, high, -1.0, 1.0)
    assert x.verdict == verdict
    assert replace(x, least=-np.inf, most=np.inf).verdict == ""


def test_limits_apply_to_their_joint_frequency_and_direction():
    limits = AcceptanceLimits(
        speed_deg=[10, 20], lowest_deg=[-30, -40], gain_db=2, phase_deg=9, up_to=3, chain_gain_db=5
    )
    inf, degree = np.inf, np.radians(1)
    assert limits.allowed("speed", "speed", 2, 0) == (20 * degree, inf)
    assert limits.allowed("excursion", "lowest", 2, 0) == (-inf, -40 * degree)
    assert limits.allowed("sine", "gain", 1, 3) == (-2, 2)
    assert limits.allowed("sine", "gain", 1, 3.1) == (-inf, inf)
    assert limits.allowed("sine", "phase", 0, 1) == (-9 * degree, inf)
    assert limits.allowed("chain", "gain", 0, 100) == (-5, 5)
    assert limits.allowed("step", "threshold", 1, 0) == (-inf, inf)
