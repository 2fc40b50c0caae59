"""What each command of `sdt-drake` prints and writes: numbers, units, files."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from command_line import (
    AXIS,
    ENDS,
    FIGURE,
    JOINTS,
    OMEGA_R,
    REST,
    RUN,
    SCENARIO,
    SHORT,
    SHORT_MOTION,
    columns_of,
    numbers,
    read_csv,
    refused,
    tables,
)

from sdt_drake.io.tables import read_table
from sdt_drake.motion import Motion
from sdt_drake.run.design import make_design
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import load_scenario
from sdt_drake.show.block_diagrams import dot_text

REAL = "package://sdt/scenarios/real_device.yaml"


# --- plan -----------------------------------------------------------------------------------------


def test_plan_of_the_reference_motion(good, given, robot):
    out = good("plan").out
    columns = columns_of(out)
    assert "30 s" in out and "6001 samples" in out
    # Peak use 0.82, 0.93, 0.30, 0.23 of the motors; limiter idle; pitch -9.9 to 1.6 deg, yaw -10.5
    # to 18.0 deg.
    assert columns["joint"] == JOINTS
    assert numbers(columns["of motor [%]"]) == pytest.approx([82, 93, 30, 23], abs=0.5)
    assert numbers(columns["held [s]"]) == [0, 0, 0, 0]
    speeds = [2.4, 1.5, 0.1257, 0.2093]
    assert numbers(columns["speed [rad/s]"]) == pytest.approx(speeds, abs=6e-4)
    assert columns["from [deg]"][2:] == ["-9.9", "-10.5"]
    assert columns["to [deg]"][2:] == ["1.6", "18.0"]
    assert "smallest margin: 7.2 %, torque of joint 2 'roll' at 9.000 s" in out
    assert len({len(line) for line in out.splitlines()[1:6]}) == 1  # aligned
    assert re.search(r"peaks grow by at most \d\.\d+ % of the motor \(joint 3\)", out)
    still = given("rest.yaml", f"duration: 0.5\njoints:\n{REST * 4}")
    assert "peaks grow by less than 0.0001 % of the motor" in good("plan", still).out
    own = robot.path.read_text(encoding="utf-8").replace("<velocity>4.7124</velocity>", "")
    out = good("plan", still, "--robot", given("own.sdf", own)).out
    assert columns_of(out)["of limit [%]"] == ["0.0", "–", "0.0", "0.0"]  # joint 2 has none


def test_plan_keeps_the_envelope_of_a_scenario(good, refuse, given):
    text = (
        "plant: {kind: coupled}\ncontroller: {kind: pi, omega_r: 66}\ndrive: {n1: [200, 0.5, 6, 6]"
    )
    slow, quick = (
        given(f"{no_load}.yaml", f"{text}, n0: [314, {no_load}, 15, 15]}}\n") for no_load in (2, 20)
    )
    for options, longer in ((("--envelope", quick), False), (("--envelope", slow), True)):
        first, second, *_ = good("plan", *options, "--planner", "retiming").out.splitlines()
        assert ("longer than commanded" in first) == longer and first.endswith("feasible")
        assert second == "within the torque-speed envelope of drive.n1 and drive.n0"
    refuse("plan", "--envelope", slow, saying=["joint 2 'roll' at ", "needs torque", "available -"])
    robot = ("--robot", given("own.sdf", ""))
    refuse("plan", "--envelope", slow, *robot, saying=["--robot: ", "2.yaml names the robot"])


def test_plan_writes_a_motion_that_every_command_takes(good, desk, given):
    first = good("plan", SHORT_MOTION, "--out", "sub/motion.csv")
    motion = Motion.from_csv(desk / "sub" / "motion.csv")
    assert (motion.period, motion.n, len(motion.time)) == (0.005, 4, 101)
    np.testing.assert_allclose(motion.v[[25, 50, 100], 1], [0.25, 0.5, 0.5], atol=1e-12)
    assert motion.q[-1, 1] == pytest.approx(0.5 * 0.25 * 0.5 + 0.25 * 0.5)
    assert first.out.splitlines()[-1] == "sub/motion.csv written"
    assert "\nnot at rest: joint 2 'roll' ends at 0.5 rad/s\n" in first.out
    again = good("plan", "sub/motion.csv", "--out", "again.csv")
    assert tables(again.out) == tables(first.out)
    assert (desk / "again.csv").read_bytes() == (desk / "sub" / "motion.csv").read_bytes()
    assert good("tune", "sub/motion.csv").out == good("tune", SHORT_MOTION).out
    run = given("csv.yaml", ENDS["coupled"].replace("motion.yaml", "../desk/sub/motion.csv"))
    assert tables(good("simulate", run).out) == tables(good("simulate", RUN).out)


def test_plan_of_other_periods(good, desk, given):
    assert "51 samples" in good("plan", SHORT_MOTION, "--period", "0.01", "--out", "slow.csv").out
    assert Motion.from_csv(desk / "slow.csv").period == 0.01
    rows = [f"{0.04 * i:g},{0.02 * min(i, 5, 25 - i):g},0,0,0" for i in range(26)]
    text = "\n".join(["time,v_ref_1,v_ref_2,v_ref_3,v_ref_4", *rows])
    out = good("plan", given("in.csv", text), "--out", "out.csv").out
    assert "resampled at 0.005 s: at most" in out and "not at rest" not in out
    assert Motion.from_csv(desk / "out.csv").period == 0.005
    out = good("plan", "../given/in.csv", "--period", "0.003").out
    assert "resampled at 0.003 s and 0.002 s longer: at most" in out


def test_plan_with_a_margin_limits_or_retimes(good, desk, given):
    rest = 3 * "  - !Knots {knots: [[0, 0], [1.5, 0]]}\n"
    start = "duration: 1.5\njoints:\n  - !Knots {knots: [[0, 0], [0.5, 0.1], "
    moving = given("moving.yaml", f"{start}[1.5, 0.1]]}}\n{rest}")
    stops = given("stops.yaml", f"{start}[1.0, 0.1], [1.5, 0]]}}\n{rest}")
    inertia, margin = 4.0424 * 67.2**2, ("--torque-margin", "0.1")  # of the arm at q = 0
    torque = 0.1 * 203.2 * 67.2  # published
    out = good("plan", moving).out
    free = {name: cells[0] for name, cells in columns_of(out).items()}
    assert float(free["torque [N m]"]) == pytest.approx(0.2 * inertia, rel=1e-3)
    assert free["held [s]"] == "0.000" and out.splitlines()[0].endswith("feasible")
    assert "from where it is commanded" not in out

    out = good("plan", moving, *margin).out
    limited = {name: cells[0] for name, cells in columns_of(out).items()}
    assert float(limited["torque [N m]"]) == pytest.approx(torque, abs=0.1)
    late = 0.1 * inertia / torque  # when it is at its speed
    assert float(limited["held [s]"]) == pytest.approx(late, abs=0.01)
    told = re.search(r"joint 1 'planetary' ends (\S+) deg from where it is commanded: .*", out)
    assert float(told[1]) == pytest.approx(np.degrees(0.1 * (late - 0.5) / 2), abs=0.06)
    assert "--planner retiming keeps the path" in told[0]
    assert "feasible with 10 % of the motors' torque" in out.splitlines()[0]
    assert re.search(r"^smallest margin: .*, held against the whole limit$", out, re.M)

    options = ("--planner", "retiming", "--drive-table", "drives.csv", "--envelope", REAL)
    out = good("plan", stops, *margin, *options).out
    assert "s longer than commanded" in out and "from where it is commanded" not in out
    _, columns = read_table(desk / "drives.csv")
    assert np.abs(columns["tau_motor"][:, 0]).max() == pytest.approx(0.1 * 203.2, rel=0.02)
    path = 67.2 * 0.1  # rad of the motor
    assert columns["q_motor"][-1, 0] == pytest.approx(path, rel=1e-3)
    assert np.sum(columns["v_motor"][:, 0]) * 0.005 == pytest.approx(path, rel=1e-3)


def test_plan_and_tune_of_another_robot(good, given):
    still = given("still.yaml", "duration: 0.5\njoints:\n" + 2 * REST)
    columns = columns_of(good("plan", still, "--robot", "../given/arm.sdf").out)
    # Held against gravity: 2 kg at 0.5 m, and 2 kg at 0.5 m and at 1.5 m.
    assert columns["joint"] == ["1 shoulder", "2 elbow"]
    assert numbers(columns["torque [N m]"]) == pytest.approx([39.24, 9.81], abs=0.06)
    assert numbers(columns["of motor [%]"]) == pytest.approx([39.2, 9.8], abs=0.06)

    robot = ("../given/arm.yaml", "--robot", "../given/arm.sdf", "--omega-r", OMEGA_R)
    columns = columns_of(good("tune", *robot).out)
    # Stretched at the start: I_m + d_kk / r², d_22 = 0.2 + 2 * 0.5², d_11 = d_22 + 0.2 + 2 * 1.5².
    i_eff = np.array([0.001 + 5.4 / 400, 0.001 + 0.7 / 400])
    assert numbers(columns["I_eff max"]) == pytest.approx(i_eff, rel=1e-4)
    assert numbers(columns["K_IS"]) == pytest.approx(OMEGA_R**2 / 4 * i_eff, rel=1e-3)
    assert numbers(columns["zeta at max"]) == [1, 1]


# --- tune and step --------------------------------------------------------------------------------


def test_tune_reproduces_table_1(good):
    out = good("tune").out
    expected = {
        "I_eff max": ([4.26, 98.01, 796.3, 250.28], 1e-4),
        "median": ([4.004, 77.61, 792.1, 250.28], 2e-4),
        "min [kg m²]": ([3.830, 66.82, 774.84, 250.28], 2e-4),
        "K_PS": ([267.1, 6340, 52000, 15700], 1e-3),
        "K_IS": ([4640, 107000, 867000, 272480], 3e-3),
        "zeta at max": ([0.95, 0.98, 0.99, 0.95], 1e-9),
        "min": ([1.002, 1.187, 1.004, 0.95], 1e-3),
    }
    columns = columns_of(out)
    for name, (values, within) in expected.items():
        assert numbers(columns[name]) == pytest.approx(values, rel=within), name
    assert numbers(columns["var. [%]"]) == pytest.approx([10.09, 31.82, 2.69, 0], abs=0.006)
    (note,) = [line for line in out.splitlines() if line.startswith("note")]
    assert note.endswith("joint 1, 2, 3")  # omega_n / omega_r is 0.5 sqrt(max / min)


def test_tune_options_and_what_it_says_of_them(good, given):
    """Published is the shipped device alone."""
    base = good("tune", SHORT_MOTION).out
    both = "omega_r = 65.991 rad/s (published for the shipped device), zeta at the largest inertia "
    assert f"{both}(published" in base and "note" not in good("tune", given(
        "rest.yaml", f"duration: 0.5\njoints:\n{REST * 4}")).out  # fmt: skip
    small = "knots: [[0, 0], [0.25, 0.01], [0.5, 0]]"  # the inertia of joint 1 falls by 1e-4
    out = good("tune", given("small.yaml", f"duration: 0.5\njoints:\n{REST}  - !Knots {{{small}}}\n"
                             f"{REST * 2}")).out  # fmt: skip
    least, most = (float(columns_of(out)[x][0]) for x in ("min [kg m²]", "I_eff max"))
    assert least < most and "note" not in out
    own = good("tune", SHORT_MOTION, "--omega-r", 100, "--zeta", 1, 1.5, 2, 0.5).out
    assert "omega_r = 100 rad/s (--omega-r), zeta at the largest inertia (--zeta)" in own
    columns, zeta = columns_of(own), np.array([1, 1.5, 2, 0.5])
    i_eff = np.array(numbers(columns["I_eff max"]))
    assert i_eff == pytest.approx(numbers(columns_of(base)["I_eff max"]))
    assert numbers(columns["K_IS"]) == pytest.approx(100**2 / 4 * i_eff, rel=1e-3)
    assert numbers(columns["K_PS"]) == pytest.approx(2 * zeta * 50 * i_eff, rel=1e-3)
    assert numbers(columns["zeta at max"]) == zeta.tolist()
    robot = ("../given/arm.yaml", "--robot", "../given/arm.sdf", "--omega-r", 30)
    assert "(--omega-r), zeta at the largest inertia (default)" in good("tune", *robot).out


def test_tune_names_what_was_given(refuse, good, given, desk):
    wrong = "controller.zeta=[0,1,1,1]"
    assert refuse("tune", "coupled_pi", "--set", wrong).startswith(
        "sdt-drake: --set controller.zeta[1]: 0, expected a number > 0"
    )
    told = refuse("tune", "coupled_pi", "--zeta", 0, 1, 1, 1)
    assert told.startswith("sdt-drake: --zeta[1]: 0.0, expected a number > 0")
    scenario = given("short.yml", SCENARIO)
    assert good("tune", scenario).out == good("tune", given("short.yaml", SCENARIO)).out


@pytest.fixture
def step(good):
    """What `step` tells, by name."""

    def run(*options):
        return {m[1]: float(m[2]) for m in re.finditer(
            r"^([a-z ]+?)\s{2,}(\S+)", good("step", *options).out, re.M)}  # fmt: skip

    return run


def test_step_of_both_structures(good, step):
    # Closed form of the loop with zeta 1: the zero of "pi" gives an overshoot of exp(-2).
    pi = step("--structure", "pi", "--zeta", "1")
    assert pi["overshoot"] == pytest.approx(100 * np.exp(-2), rel=1e-3)
    assert pi["peak"] == pytest.approx(1 + np.exp(-2), rel=1e-4)
    assert pi["peak time"] == pytest.approx(2 / (OMEGA_R / 2), rel=0.01)
    assert pi["rise time"] == pytest.approx(0.022, abs=5e-4)
    p = step("--zeta", "0.95")
    assert p["rise time"] == pytest.approx(0.0944, rel=0.01)
    assert p["settling time"] == pytest.approx(0.1594, rel=0.01)
    assert p["overshoot"] == pytest.approx(0.00706, abs=2e-4)  # exp(-pi zeta / sqrt(1 - zeta²))
    first = "p_in_feedback: inertia 4.26 kg m², omega_r = 65.991 rad/s, zeta 1"
    assert good("step").out.startswith(f"{first} (inertia and omega_r published for the shipped")


def test_step_of_hardly_damped_and_of_stiff_loops(step):
    swings = step("--zeta", "0.01")
    assert swings["overshoot"] == pytest.approx(100 * np.exp(-np.pi * 0.01), rel=1e-4)
    assert swings["peak time"] == pytest.approx(np.pi / (OMEGA_R / 2), rel=0.005)
    stiff = step("--structure", "pi", "--zeta", "30")  # all but one pole, at 2 zeta omega_n
    assert stiff["rise time"] == pytest.approx(np.log(9) / (30 * OMEGA_R), rel=0.005)


def test_step_scales_with_the_frequency_and_not_with_the_inertia(good, step):
    """omega_r = 10 rad/s: zeta 1 rises in 3.36 / omega_n = 0.67 s and settles in 1.17 s."""
    slow = step("--omega-r", "10", "--inertia", "800")
    assert slow["rise time"] == pytest.approx(3.358 / 5, rel=0.01)
    assert slow["settling time"] == pytest.approx(5.834 / 5, rel=0.01)
    assert "published" not in good("step", "--inertia", "3", "--omega-r", "1e9").out  # and it ends


def written(good, desk, *arguments):
    """What a command writes as JSON."""
    good(*arguments, "--out", f"{arguments[0]}.json")
    result = json.loads((desk / f"{arguments[0]}.json").read_text(encoding="utf-8"))
    named = {re.sub(r"_[1-9]$", "", name) for name in result["columns"]} | set(result)
    assert set(result["units"]) <= named
    return result


def test_design_numbers_are_the_same_in_both_kinds_of_files(good, desk):
    for command in (("tune", SHORT_MOTION), ("step", "--zeta", 2)):
        columns = written(good, desk, *command)["columns"]
        good(*command, "--out", f"{command[0]}.csv")
        header, *rows = read_csv(desk / f"{command[0]}.csv")
        assert header == list(columns)
        for column, values in zip(zip(*rows, strict=True), columns.values(), strict=True):
            assert list(column) == [f"{value}" for value in values]


def test_design_numbers_go_out(good, desk, coarse):
    tuned = written(good, desk, "tune", SHORT_MOTION)
    columns = {name: np.array(values) for name, values in tuned["columns"].items()}
    assert columns["joint"].tolist() == [1, 2, 3, 4] and tuned["omega_r"] == OMEGA_R
    omega_n = OMEGA_R / 2
    np.testing.assert_allclose(columns["ki"], omega_n**2 * columns["i_eff_max"])
    np.testing.assert_allclose(columns["kp"], 2 * columns["zeta_max"] * columns["ki"] / omega_n)
    np.testing.assert_allclose(columns["omega_n_min"] ** 2 * columns["i_eff_min"], columns["ki"])

    step = written(good, desk, "step", "--inertia", 2, "--zeta", 1)
    told = good("step", "--inertia", 2, "--zeta", 1).out
    assert f"K_PS = {2 * omega_n * 2:.5g} N m s/rad, K_IS = {omega_n**2 * 2:.5g} N m/rad" in told
    assert (step["kp"], step["ki"]) == pytest.approx((2 * omega_n * 2, omega_n**2 * 2))
    t, v = np.array(step["columns"]["time"]), np.array(step["columns"]["v"])
    np.testing.assert_allclose(v, 1 - (1 + omega_n * t) * np.exp(-omega_n * t), atol=1e-5)

    sweep = written(good, desk, "stability", "../given/axis.yaml")
    columns, n = sweep["columns"], len(sweep["columns"]["ratio"]) // 2
    assert columns["encoder"] == ["motor"] * n + ["link"] * n
    for border, damping in (("unstable_from_2", "damping_2"), ("unstable_from_4", "damping_4")):
        for ratio, limit, zeta in zip(
            columns["ratio"], columns[border], columns[damping], strict=True
        ):
            assert (zeta < 0) == (limit is not None and ratio > limit)

    budget = written(good, desk, "budget", AXIS)
    whole = np.array(budget["columns"]["whole_2"])
    assert budget["rms"]["whole"][1] == pytest.approx(np.sqrt(np.mean(whole**2)))
    bode = written(good, desk, "bode", "../given/axis.yaml")
    omega, size = (np.array(bode["columns"][x]) for x in ("omega", "tracking_magnitude_1"))
    assert np.interp(bode["bandwidth"][0], omega, size) == pytest.approx(np.sqrt(0.5), rel=1e-4)


# --- simulate and diagram -------------------------------------------------------------------------


def test_simulate_prints_and_writes_the_same_run(good, desk):
    out = good("simulate", "../given/coupled.yaml", "--out", "out.csv").out
    time, columns = read_table(desk / "out.csv")
    shown = columns_of(out)
    assert out.startswith("coupled: pi on the coupled plant\n") and shown["joint"] == JOINTS
    np.testing.assert_allclose(time, 0.005 * np.arange(251), atol=1e-12)
    assert list(columns) == [
        "v_ref", "v", "tau_cmd", "tau", "load_torque", "speed_error", "q_ref", "q", "tau_limited",
        "tau_peak", "tau_rms", "tau_mean", "saturated", "beyond_stop",
    ]  # fmt: skip
    error, lost = columns["speed_error"], np.degrees(columns["q"] - columns["q_ref"])
    for name, expected, within in (
        ("largest error [rad/s]", np.abs(error).max(axis=0), 6e-5),
        ("RMS [rad/s]", np.sqrt(np.mean(error**2, axis=0)), 6e-5),
        ("position [deg]", np.abs(lost).max(axis=0), 6e-4),
    ):
        assert numbers(shown[name]) == pytest.approx(expected, abs=within), name
    assert np.abs(error[:, 1]).max() > 0.1  # the lag: 2 zeta / omega_n * 2 rad/s²
    assert shown["constant speed [rad/s]"][0] == "–"


def test_simulate_tells_saturation_in_percent(good, desk, given):
    friction = "kind: axis, friction: {coulomb: [0, 600, 0, 0]}"  # the planner does not know it
    text = SCENARIO.replace("motion.yaml", "short.yaml").replace("kind: axis", friction)
    drive = "drive: {n1: [1, 0.1, 1, 1], n0: [300, 0.58, 9, 9]}\n"
    out = good("simulate", given("weak.yaml", text + drive), "--out", "weak.csv").out
    share = read_table(desk / "weak.csv")[1]["saturated"][1:].mean(axis=0)
    assert share[1] > 0.05
    assert numbers(columns_of(out)["saturated [%]"]) == pytest.approx(100 * share, abs=0.006)


def test_simulate_at_rest_at_speed_and_for_one_period(good, desk, given):
    """At constant speed throughout, without gravity or coupling, there is no error to show."""
    for name, motion, most in (
        ("rest", f"duration: 0.5\njoints:\n{REST * 4}", 0),
        ("spin", f"duration: 0.5\njoints:\n{REST * 3}{REST.replace(' 0]', ' 0.2]')}", 1e-3),
        ("one", SHORT.replace("[0.25, 0.5], ", "").replace("0.5", "0.005"), 1),
    ):
        given(f"{name}_motion.yaml", motion)
        run = given(f"{name}.yaml", ENDS["coupled"].replace("motion.yaml", f"{name}_motion.yaml"))
        columns = columns_of(good("simulate", run, "--out", f"{name}.csv").out)
        assert max(numbers(columns["largest error [rad/s]"])) <= most
    assert len(read_table(desk / "one.csv")[0]) == 2


def test_diagram(good, desk):
    assert good("diagram", RUN).out == "run.dot written\n"
    drawn = (desk / "run.dot").read_text(encoding="utf-8")
    assert drawn == dot_text(make_loop(make_design(load_scenario(RUN))))
    assert good("diagram", RUN, "--out", "x/y.dot").out == "x/y.dot written\n"
    assert (desk / "x" / "y.dot").read_text(encoding="utf-8") == drawn and "K_PS" in drawn
    good("diagram", RUN, "--depth", 0)
    assert "K_PS" not in (desk / "run.dot").read_text(encoding="utf-8")
    good("diagram", RUN, "--drake", "--depth", 0)
    assert (desk / "run.dot").read_text(encoding="utf-8").count("PORT=") > 10


def test_diagram_as_a_picture_without_graphviz(call, good, desk, monkeypatch):
    monkeypatch.setenv("PATH", str(desk))
    refused(call("diagram", RUN, "--format", "svg", "--drake"), "Graphviz", "install")
    assert list(desk.iterdir()) == []
    good("diagram", RUN, "--format", "svg")
    good("diagram", RUN, "--out", "loop.png")
    good("diagram", RUN, "--out", "loop.pdf")
    good("diagram", RUN, "--drake")
    files = {path.name: path.read_bytes() for path in desk.iterdir()}
    assert set(files) == {"run.svg", "loop.png", "loop.pdf", "run.dot"}
    assert all(files[name].startswith(FIGURE[name[-3:]]) for name in files if name != "run.dot")
