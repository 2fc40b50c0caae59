"""Recordings replayed: of runs, whose differences are known."""

import re

import numpy as np
import pytest
from oracles import dh

from sdt_drake.io.errors import InputError
from sdt_drake.machine.diagnose.spikes import without_spikes
from sdt_drake.machine.recordings.reading import read_recording
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.machine.replay import ALONE, AS_IT_IS, UNFED, _smoothed, replay
from sdt_drake.motion import Motion
from sdt_drake.run.controllers import Pi
from sdt_drake.run.scenario import Drive, Friction, PlantChoice, Scenario, save_scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.show.reports.replay import replay_findings, tables

CASCADE = {"kind": "p_pi", "setpoint_weight": 0, "feedforward": "id"}
CASCADE = {f"controller.{name}": value for name, value in CASCADE.items()}
SPRINGS = {
    "plant.elasticity.natural_frequency": [60.0, 0.0, 0.0, 0.0],
    "drive": Drive(period=0.0025),
}


def recorded_run(made, tmp_path, **more):
    """A run as a file, and read again; `more` columns beside it."""
    path = tmp_path / "run.csv"
    simulate(made).save(path)
    recorded = read_recording(path, made.device.simulated)
    assert recorded.of_links
    return Recorded(recorded.path, recorded.time, recorded.signals | more, of_links=True)


def replayed(made, recorded, fields=None):
    return replay(recorded, made.scenario.changed(fields or {}))


def test_replay_of_own_run_has_no_error_and_misses_each_left_out_part(designed, tmp_path):
    fields = {**CASCADE, **SPRINGS}
    made = designed("real_device", fields, start=1.0, end=2.0, rest=100)
    result = replayed(made, recorded_run(made, tmp_path))
    assert list(result.measured) == ["speed_error", "position_error", "torque"]
    for name, tolerance in (("speed_error", 1e-9), ("position_error", 1e-9), ("torque", 1e-6)):
        assert result.recorded_rms(name).min() > 1e3 * tolerance
        assert result.difference(name).max() < tolerance
    for case in ("without friction", "with rigid joints", "with ideal drives"):
        assert result.difference("position_error", case)[0] > 1e-7
    assert "with the nominal links" not in result.courses and UNFED not in result.courses
    assert np.isnan(result.due_to_model).all()
    assert tables(result)[0].rows[-1][0] == "of the difference, controller, drives, springs [%]"
    result.measured["torque"][:, 2] = 1e-12  # round-off of a joint at rest
    result.measured["torque"][:, 3] /= 1000  # 999 times as far off as what was recorded
    assert np.isnan(result.explained("torque")).tolist() == [False, False, True, False]
    (said,) = (line for line in replay_findings(result) if "% of the motor torque;" in line)
    assert "explains 100.0 100.0 – – %" in said and "joint 4" in said and "999 times" in said
    result.measured["position_error"][:, 2] = 0
    assert np.isnan(result.due_to_model).all()  # of a joint that was at rest, too


def test_replay_tells_wrong_payload_from_wrong_gain(designed, tmp_path):
    """By the load that is fed in: it makes good what the plant lacks, and no other gain; wherever
    the encoders have their zeros."""
    made = designed("coupled_pi", CASCADE, start=1.0, end=4.0)
    recorded = recorded_run(made, tmp_path)
    recorded.signals["q"] += 0.3

    softer = list(made.tuning.position_gain / 3)
    wrong_plant = replayed(made, recorded, {"plant.deviation.payload_mass": 60.0})
    wrong_gain = replayed(made, recorded, {"controller.position_gain": softer})
    assert wrong_plant.difference("position_error", "with the nominal links").max() < 1e-6
    assert wrong_plant.due_to_model[1] > 0.9
    assert wrong_gain.due_to_model.max() < 0.1
    off = wrong_plant.difference("torque", ALONE), wrong_gain.difference("torque", ALONE)
    assert np.all(off[0] < 0.05 * off[1])


def test_replay_uses_the_recorded_feedforward(designed, tmp_path):
    made = designed("coupled_pi", CASCADE, start=0.0, end=1.0)
    fed = made.tuning.feedforward.along * made.device.simulated.gear_ratio
    recorded = recorded_run(made, tmp_path, tau_ff=fed)
    result = replayed(made, recorded, {"controller.feedforward": None})
    assert result.difference("torque", AS_IT_IS).max() < 1e-6
    assert np.all(result.difference("torque", UNFED) > 0.1)
    assert any("recorded torque feedforward" in x for x in replay_findings(result))


def test_replay_names_what_explains_more_than_the_scenario(designed, tmp_path):
    """Friction that the machine does not have, and a model whose own recording knows better."""
    made = designed("coupled_pi", CASCADE, start=1.0, end=2.0)
    recorded = recorded_run(made, tmp_path)
    rubs = {"plant.friction": Friction(coulomb=[300.0, 200.0, 200.0, 100.0])}
    result = replayed(made, recorded, rubs)
    (joints,) = result.better("torque").values()
    assert list(result.better("torque")) == ["without friction"] and joints[2:].all()
    (said,) = (x for x in replay_findings(result) if "explains more of the motor torque" in x)
    assert said.startswith("The simulation without friction explains more")
    assert said.endswith("identify the friction alone.")
    assert "–" in str(result) and not re.search(r" -\d", str(result))
    assert not replayed(made, recorded).better("torque")


def test_speed_reference_starts_at_recorded_angles(designed, tmp_path):
    """Gravity and inertias are those of the pose; the offset of a reference that nobody recorded
    is no news."""
    made = designed("coupled_pi", start=1.0, end=1.5)
    v = (
        made.reference.tracked.v * np.clip(made.reference.tracked.time / 0.2, 0, 1)[:, None]
    )  # from rest
    motion = Motion.from_speeds(
        made.reference.tracked.period, made.reference.tracked.q[0] + [0, 0.8, 0, 0.5], v
    )
    made = designed("coupled_pi", motion=motion)
    recorded = recorded_run(made, tmp_path)
    del recorded.signals["q_ref"]
    result = replayed(made, recorded)
    assert result.difference("torque").max() < 1e-6 and not result.start.any()
    assert not any("start" in line for line in replay_findings(result))
    del recorded.signals["q"]
    result = replayed(made, recorded)
    assert result.difference("torque").max() > 10
    assert any(x.startswith("No positions were recorded") for x in replay_findings(result))


def test_controller_alone_equals_its_law_on_recorded_motion(designed):
    """K_P r (v_ref - v) + K_I r (integral of v_ref - q), with the reference held."""
    fields = {"controller.setpoint_weight": 1}
    made = designed("coupled_pi", fields, start=1.0, end=1.5)
    motion, ratio = made.reference.tracked, made.device.simulated.gear_ratio
    q = motion.q + 0.3 - 2e-4 * (1 - np.cos(8 * motion.time))[:, None]
    v = motion.v - 2e-4 * 8 * np.sin(8 * motion.time)[:, None]
    signals = {"v_ref": motion.v, "q_ref": motion.q, "q": q, "v": v, "tau": 0 * v}
    recorded = Recorded("run.csv", 2.0 + motion.time, signals)
    result = replayed(made, recorded, {"learned": "no such file"})
    np.testing.assert_allclose(result.start, 0.3)  # an encoder's zero is no error
    error = q - 0.3 - motion.q
    np.testing.assert_allclose(result.measured["position_error"], error, atol=1e-9)
    left = result.courses[AS_IT_IS]["position_error"] - error
    explained = 1 - np.mean(left**2, axis=0) / np.mean(error**2, axis=0)
    np.testing.assert_allclose(result.explained("position_error"), explained, rtol=1e-9)
    held = np.vstack([motion.v[:1], motion.v[:-1]])
    integral = np.vstack([0 * v[:1], np.cumsum(motion.v[:-1], axis=0) * motion.period])
    gone = integral - (q - q[0])
    asked = ratio * (made.tuning.gains.kp * (held - v) + made.tuning.gains.ki * gone)
    expected = (asked - asked.mean(axis=0))[1:]
    found = result.courses[ALONE]["torque"][1:]
    assert found == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())
    # What the integrals began with, the recording tells, also where it is more than a motor has.
    recorded.signals["tau"] = recorded.signals["tau"] + 150.0 * ratio
    result = replayed(made, recorded)
    assert result.courses[ALONE]["torque"][1:, 1:] == pytest.approx(found[:, 1:] + 150.0)
    torque = result.courses[ALONE]["torque"][:, 0]
    assert np.abs(torque).max() <= made.device.simulated.motor_torque_limit[0]


def test_saturated_motor_does_not_change_the_law(designed, tmp_path):
    """Joint 2 saturates; the controller asks for more than it has."""
    made = designed("axis_pi", end=9.4)
    assert 0.02 < simulate(made).saturated[:, 1].mean() < 0.5
    result = replayed(made, recorded_run(made, tmp_path))
    assert result.difference("torque", ALONE)[1] < 0.01 * result.recorded_rms("torque")[1]


def test_load_is_smoothed_without_phase_shift():
    step = np.repeat([[0.0], [1.0]], 50, axis=0)
    smooth = _smoothed(step, 0.005)
    np.testing.assert_allclose(smooth, 1 - smooth[::-1], atol=1e-12)
    assert 0 < smooth[49, 0] < 0.5 < smooth[50, 0] < 1 and smooth[0, 0] == 0


def test_recording_that_cannot_be_replayed_is_refused(design):
    time, rest = np.array([0.0, 0.005, 0.01]), np.zeros((3, 4))
    bare = {"q": rest, "tau": rest}
    for signals, said in ((bare, "neither q_ref"), ({"v_ref": rest}, "none of q, v and tau")):
        with pytest.raises(InputError, match=f"a.csv: {said}"):
            replay(Recorded("a.csv", time, signals), design.scenario)


SPIKES = {"q": 10.0, "q_ref": -10.0, "v": 40.0, "v_ref": 40.0, "tau": 1e7}


@pytest.mark.parametrize("name", SPIKES)
def test_spike_is_named_and_left_out_of_the_explained_share(designed, tmp_path, name):
    """A reference that jumps is followed by no machine: its error would explain itself."""
    made = designed("coupled_pi", CASCADE, start=1.0, end=2.0)
    recorded = recorded_run(made, tmp_path)
    plain = replayed(
        made, recorded, {"controller.position_gain": list(made.tuning.position_gain / 3)}
    )
    recorded.signals[name][[60, 61, 150], 1] += SPIKES[name]
    marked = recorded.signals[name].copy()
    result = replayed(
        made, recorded, {"controller.position_gain": list(made.tuning.position_gain / 3)}
    )
    assert np.array_equal(recorded.signals[name], marked)  # the caller's own
    for quantity in result.measured:
        off = np.abs(result.explained(quantity) - plain.explained(quantity)).max()
        assert off < 0.01, quantity
    said = f"run.csv: {name}_2: 3 value(s) far from all around"
    assert any(said in line for line in replay_findings(result))


def test_steps_noise_and_quick_moves_are_not_spikes(designed, tmp_path):
    made = designed("coupled_pi", CASCADE, start=1.0, end=2.0)
    recorded = recorded_run(made, tmp_path)
    random = np.random.default_rng(1)
    for name, values in recorded.signals.items():
        values *= 1 if name == "tau" else 30
        values[100:] += 5
        values += random.normal(0, 1, values.shape)
    assert without_spikes(recorded, made.device.simulated).notes == ()


def test_implausible_recorded_torques_give_bounded_replay_speeds(designed, tmp_path):
    made = designed("coupled_pi", CASCADE, start=1.0, end=1.5)
    recorded = recorded_run(made, tmp_path)
    recorded.signals["tau"][20:60] = 1e7
    result = replayed(made, recorded)
    assert np.abs(result.courses["with the load that the model lacks"]["speed_error"]).max() < 1e3


def test_replay_tells_a_cut_last_line(designed, tmp_path):
    made = designed("coupled_pi", CASCADE, start=1.0, end=1.5)
    recorded_run(made, tmp_path)
    path = tmp_path / "run.csv"
    path.write_text(path.read_text()[:-30])
    result = replayed(made, read_recording(path, made.device.simulated))
    assert any("last line is incomplete" in line for line in replay_findings(result))


# --- a real robot ----------------------------------------------------------------------------


@dh.needs_data
def test_the_kuka_under_the_gains_of_its_data_set(good, desk, undrawn):
    """Their law is a PI speed loop with both gains on the error. Torques agree by and large; the
    wrist's errors are far larger than these gains leave, and the controller alone tells why."""
    table, ratio = dh.KUKA_KR300, np.array(dh.KUKA_KR300.gear_ratio)
    speed_gain = np.array([1046.4, 1137.6, 1073.4, 63.12, 68.44, 44.08])
    coulomb, viscous = [1.6, 2.1, 2.0, 0.62, 0.41, 0.67], [7.0, 6.9, 5.3, 0.75, 2.4, 2.5]
    friction = Friction(coulomb=list(ratio * coulomb), viscous=list(ratio * viscous))
    gains = {"kp": list(speed_gain / ratio), "ki": list(572.96 / ratio)}
    scenario = Scenario(
        robot=str(table.write(desk)),
        period=0.004,
        plant=PlantChoice(kind="coupled", friction=friction),
        controller=Pi(setpoint_weight=1, **gains),
    )
    save_scenario(scenario, desk / "kuka.yaml")
    columns = "q: ['q_motor_{k}']\ntau: ['motor_torque_{k}']\ntau_ff: ['motor_feedforward_{k}']"
    (desk / "columns.yaml").write_text(f"{columns}\nside: motor\n")
    lines = (dh.DATA / "kuka_kr300/recording_B.csv").read_text().splitlines()[:801]
    (desk / "b.csv").write_text("\n".join(lines))
    said = good("replay", "b.csv", "kuka.yaml", "--columns", "columns.yaml", "--out", "out").out
    assert "the recorded torque feedforward replaces the controller's own" in said
    assert "controller commands joint 4, 5, 6 a torque with an error" in said
    rows = {row.split("  ")[0]: row.split()[-6:] for row in said.splitlines()}
    del rows["motor torque"][1]  # of the joint with a counterbalance, which this model lacks
    assert all(float(share) > 40 for share in rows["motor torque"])
