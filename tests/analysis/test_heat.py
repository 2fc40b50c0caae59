"""Temperatures of windings, by closed forms of constant torque and of repeated flights."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from sdt_drake.analysis.heat import heat_of
from sdt_drake.cli.app import main
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.robot.motors import Motor, load_catalogue
from sdt_drake.robot.windings import WindingChoice, Windings, windings_of
from sdt_drake.run.loop import make_loop
from sdt_drake.run.recording import Recording
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import simulate

FITTED = ["AC-203", "TM-3950", "TM-2150", "TM-2150"]
WARM = {"device.fitted": FITTED, "plant.windings": {"coolant": 30.0, "initial": 50.0}}


def test_winding_warms_as_by_closed_form_under_constant_torque(designed):
    """30 + 105 (u + (u_0 - u) exp(-t / T)), u = (tau / tau_rated)², T = 180 s and 2700 s."""
    still = Motion.from_speeds(0.005, np.zeros(4), np.zeros((601, 4)))
    loop = make_loop(designed("axis_pi", WARM, motion=still), controller="external")
    torque, builder = np.array([100.0, -2500.0, 0.0, 960.0]), DiagramBuilder()
    builder.AddNamedSystem("loop", loop.diagram)
    source = builder.AddNamedSystem("torque", ConstantVectorSource(torque))
    builder.Connect(source.get_output_port(), loop.GetInputPort("tau_cmd"))
    run = simulate(loop, builder.Build())
    heat = (torque / [68.0, 1780.0, 960.0, 960.0]) ** 2
    decay = np.exp(-run.time[:, None] / [2700.0, 180.0, 180.0, 180.0])
    expected = 30 + 105 * (heat + (20 / 105 - heat) * decay)
    np.testing.assert_allclose(run.winding_temperature, expected, rtol=1e-7)


@pytest.fixture(scope="module")
def run(designed):
    """2 s of the coupled plant with weak windings of two parts, as the second flight begins."""
    design = designed("coupled_pi_ctc", WARM, start=9.0, end=11.0)
    return design, simulate(design)


def test_recorded_temperature_is_that_of_the_torque_of_the_periods(run):
    """The block integrates tau² in the loop, `heat_of` takes the mean square of each period."""
    design, recording = run
    own = windings_of([load_catalogue().motor(x, "") for x in FITTED], WindingChoice(30.0, 50.0))
    heat = heat_of(recording, own)
    rise = recording.winding_temperature.max(axis=0) - 50
    assert rise.max() > 0.1
    np.testing.assert_allclose(heat.highest, recording.winding_temperature.max(axis=0), atol=1e-4)
    np.testing.assert_array_equal(design.windings.limit, own.limit)


def recorded(torque, period=0.5):
    """A recording of one joint with these torques in its periods."""
    rows = np.append(0.0, torque)[:, None]
    empty = np.zeros_like(rows)
    signals = dict.fromkeys(
        ("q_ref", "v_ref", "q", "v", "tau_cmd", "tau_limited", "tau", "load_torque"), empty
    )
    more = {"tau_peak": rows, "tau_rms": rows, "tau_mean": rows, "saturated": empty}
    time = period * np.arange(len(rows))
    return Recording(time=time, **signals, **more, beyond_stop=empty)


def one(T, share, **temperatures):
    T, share = (np.array(x, dtype=float)[:, None] for x in (T, share))
    numbers = np.array([[10.0], [105.0], [155.0]])
    return Windings(*numbers, T, share, **temperatures)


@pytest.mark.parametrize(("T", "share"), [((40.0,), (1.0,)), ((40.0, 900.0), (0.7, 0.3))])
def test_flights_back_to_back_end_where_on_and_off_has_its_steady_state(T, share):
    """u (1 - exp(-t_on / T)) / (1 - exp(-D / T)) of each part, at the end of the load."""
    on, off = 12.0, 28.0
    load = np.append(np.full(24, 15.0), np.zeros(56))
    heat = heat_of(recorded(load), one(T, share, coolant=20.0, initial=20.0))
    t, s = np.array([T, share])
    parts = s * 1.5**2 * (1 - np.exp(-on / t)) / (1 - np.exp(-(on + off) / t))
    assert heat.endless[0] == pytest.approx(20 + 105 * sum(parts), rel=1e-9)


@pytest.mark.parametrize("torque", [12.0, 20.0])
def test_time_to_the_limit_under_constant_torque_is_t_log(torque):
    """T ln((u - u_0) / (u - u_max)); it is never met below 11.34 N m = 10 sqrt(135 / 105)."""
    windings, u = one((60.0,), (1.0,), coolant=20.0, initial=41.0), (torque / 10) ** 2
    heat = heat_of(recorded(np.full(60, torque)), windings)
    expected = 60 * np.log((u - 0.2) / (u - 135 / 105))
    assert heat.time_to_limit[0] == pytest.approx(expected, abs=0.5)  # at samples of 0.5 s
    assert heat.time_to_limit[0] >= expected
    for calm in (11.3, 0.0):
        assert np.isinf(heat_of(recorded(np.full(60, calm)), windings).time_to_limit[0])


def test_a_winding_that_starts_too_hot_is_told_in_its_first_flight(robot):
    windings = one((60.0,), (1.0,), coolant=20.0, initial=160.0)
    heat = heat_of(recorded(np.zeros(60)), windings)
    assert heat.time_to_limit[0] == 0 and heat.endless[0] == 20
    text = heat.sentence(robot, 30.0)
    assert text.startswith("may not be flown back to back") and text.endswith(
        "after 0 s, in flight 1"
    )


def test_column_survives_its_file_and_is_left_out_without_windings(run, designed, tmp_path):
    _, recording = run
    recording.save(path := tmp_path / "run.csv")
    assert "winding_temperature_4" in path.read_text().partition("\n")[0]
    again = Recording.load(path).winding_temperature
    np.testing.assert_array_equal(again, recording.winding_temperature)
    cold = simulate(designed("coupled_pi_ctc", end=0.1))
    assert cold.winding_temperature is None and "winding_temperature" not in cold._columns


def test_windings_change_no_motion(run, designed):
    _, recording = run
    cold = simulate(designed("coupled_pi_ctc", {"device.fitted": FITTED}, start=9.0, end=11.0))
    np.testing.assert_allclose(recording.v, cold.v, atol=3e-5)


def test_simulate_and_its_page_tell_whether_it_may_be_flown_again(tmp_path, capsys):
    (motion := tmp_path / "m.yaml").write_text(SPINS)
    fields = ["plant.windings.coolant=25", f"device.fitted={FITTED}", f"motion={motion}"]
    sets = [word for field in fields for word in ("--set", field)]
    page = tmp_path / "run.html"
    assert main(["simulate", "coupled_pi", *sets, "--out", str(page)]) == 0
    [line] = [x for x in capsys.readouterr().out.splitlines() if "back to back" in x]
    assert line.startswith("the motion may be flown back to back: the winding of joint ")
    text = page.read_text(encoding="utf-8")
    assert "may be flown back to back" in text and "back to back for ever" in text


SPINS = "duration: 1\njoints:\n  - !Knots {knots: [[0, 0], [1, 0]]}\n"
SPINS += "  - !Knots {knots: [[0, 0], [0.5, 0.3], [1, 0]]}\n"
SPINS += 2 * "  - !Knots {knots: [[0, 0], [1, 0]]}\n"


# --- what is refused -----------------------------------------------------------------------------


def test_bad_windings_are_one_line_with_field_and_limits(designed):
    for fields, message in (
        ({"initial": 40.0}, "plant.windings.coolant: missing"),
        ({"coolant": 500.0}, "plant.windings.coolant: 500.0, expected a number >= -50 and <= 150"),
        ({"coolant": 20.0}, "plant.windings.coolant: 20, but device: joint 1 has no motor of the"),
    ):
        with pytest.raises(InputError) as refused:
            designed("axis_pi", {"plant.windings": fields}, end=0.1)
        [line] = f"{refused.value}".splitlines()
        assert message in line
    good = load_catalogue().motor("TM-716", "")
    with pytest.raises(InputError, match="housing_time_constant: missing, required with a housing"):
        replace(good, housing_share=0.3)
    with pytest.raises(InputError, match=r"housing_share: 1.0, expected a number >= 0 and < 1"):
        replace(good, housing_share=1.0)


def test_a_housing_adds_a_slow_part():
    good = load_catalogue().motor("TM-716", "")
    slow = replace(good, housing_share=0.3, housing_time_constant=3000.0)
    windings = windings_of([good, slow])
    np.testing.assert_array_equal(windings.share, [[1.0, 0.7], [0.0, 0.3]])
    np.testing.assert_array_equal(windings.time_constant, [[180.0, 180.0], [180.0, 3000.0]])
    assert isinstance(good, Motor) and windings_of([good]).share.shape == (1, 1)
    assert load_scenario("axis_pi").plant.windings.coolant is None
