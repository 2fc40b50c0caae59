"""Recordings: files, a second run, and identities between their columns for any robot."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.strategies import motions, robots
from helpers.variants import weaker
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.by_hand import LIMIT
from pydrake.systems.framework import LeafSystem

from sdt_drake.analysis.tracking import stops_passed
from sdt_drake.io.errors import InputError
from sdt_drake.run.controllers import CONTROLLERS, Controller, register_controller
from sdt_drake.run.design import make_design
from sdt_drake.run.loop import make_loop
from sdt_drake.run.recording import Recording
from sdt_drake.run.scenario import PlantChoice, Scenario
from sdt_drake.run.simulate import _beyond_stop, simulate

COLUMNS = (
    "v_ref", "v", "tau_cmd", "tau", "load_torque", "speed_error", "q_ref", "q", "tau_limited",
    "tau_peak", "tau_rms", "tau_mean", "saturated", "beyond_stop",
)  # fmt: skip


@pytest.fixture(scope="module", params=["axis", "coupled"])
def design(designed, request):
    """PI + CTC, disturbed, 2 s, with motors that are too weak by 40 %."""
    fields = {"plant.kind": request.param, "disturbance.amplitude": 0.05}
    return weaker(designed("coupled_pi_ctc", fields, end=2.0), 0.6)


@pytest.fixture(scope="module")
def recording(design):
    return simulate(design)


def test_recording_has_every_sample_and_torques_before_updates(design, recording):
    """Row i has the load and the limits of sample i - 1, and the speed at its own time."""
    motion, (load, help_) = design.reference.tracked, design.loads
    np.testing.assert_array_equal(recording.time, np.arange(401) * 0.005)
    np.testing.assert_array_equal(recording.q_ref, motion.q)
    np.testing.assert_array_equal(recording.v_ref, motion.v)
    np.testing.assert_array_equal(recording.speed_error, recording.v - motion.v)
    np.testing.assert_array_equal(recording.load_torque[1:], load[:-1])
    limit = 0.6 * LIMIT
    help_ = help_[:-1] if design.scenario.plant.kind == "axis" else np.zeros((400, 4))
    lower, upper = -limit + np.minimum(help_, 0), limit + np.maximum(help_, 0)
    np.testing.assert_allclose(
        recording.tau[1:], np.clip(recording.tau_cmd[1:], lower, upper), rtol=1e-12
    )
    assert np.any(recording.tau != recording.tau_cmd)


def test_recording_comes_back_from_csv_and_a_second_run(design, recording, tmp_path):
    recording.save(path := tmp_path / "run.csv")
    header = path.read_text().partition("\n")[0]
    assert header == ",".join(["time", *(f"{name}_{k}" for name in COLUMNS for k in (1, 2, 3, 4))])
    loop = make_loop(design)
    simulate(loop)
    for other in (Recording.load(path), simulate(loop)):
        for name in ("time", *COLUMNS):
            assert getattr(other, name).tobytes() == getattr(recording, name).tobytes(), name


def test_summary_has_the_share_of_time_in_saturation(recording):
    saturated = np.zeros_like(recording.saturated)
    saturated[0], saturated[1:101, 0], saturated[400, 1] = 1, 1, 0.5  # of 400 periods
    shown = replace(recording, saturated=saturated).summary()
    column = list(shown.header).index("saturated [%]")
    assert [row[column] for row in shown.rows] == ["25.00", "0.12", "0.00", "0.00"]


def test_error_in_python_of_the_loop_is_told_as_that_of_its_controller(designed):
    """Drake's own RuntimeError is that of an integrator without progress."""

    class Failing(LeafSystem, Controller):
        def __init__(self, design):
            super().__init__()
            self.DeclareVectorInputPort("sampled_state", 8)
            self.DeclareVectorOutputPort("tau_cmd", 4, self.calc)

        def calc(self, context, output):
            if context.get_time() > 0.05:
                raise RuntimeError("out of ideas")
            output.SetFromVector(np.zeros(4))

    register_controller("failing", Failing)
    with pytest.raises(InputError, match=r"fails \(RuntimeError: out of ideas\)"):
        simulate(designed("coupled_pi", {"controller.kind": "failing"}, end=0.1))


def test_old_columns_of_a_recording_work_and_warn(recording, tmp_path):
    with pytest.warns(DeprecationWarning, match=r"Recording\.to_csv is Recording\.save now"):
        recording.to_csv(path := tmp_path / "run.csv")
    with pytest.warns(DeprecationWarning, match=r"Recording\.from_csv is Recording\.load now"):
        np.testing.assert_array_equal(Recording.from_csv(path).q, recording.q)


def test_simulate_with_old_arguments_works_and_warns(designed):
    """As up to 0.4, where a scenario was refused."""
    loop = make_loop(designed("axis_pi", end=0.1))
    for of in (loop.design, loop.design.scenario):
        with pytest.warns(
            DeprecationWarning, match=r"is simulate\(loop\) now, and goes in 0\.7"
        ) as told:
            run = simulate(of, loop)
        assert told[0].filename == __file__
        np.testing.assert_array_equal(run.v, simulate(loop).v)


def test_excess_beyond_joint_stops_equals_formula(design, recording):
    """Stops do not act; the axis plant has none."""
    stops = {"position_lower": np.full(4, -1.0), "position_upper": np.full(4, 2.0)}
    design = replace(design, nominal=replace(design.device.simulated, **stops))
    beyond = [0, 0.5, 0.25, 0] if design.scenario.plant.kind == "coupled" else [0] * 4
    q = np.array([[0.0, -1.5, 2.25, 2.0]])
    np.testing.assert_array_equal(_beyond_stop(design, q), [beyond])
    run = replace(recording, beyond_stop=np.tile([0, 0, 0, 0.02], (401, 1)))
    [line] = stops_passed(run, design.device.simulated.joint_names)
    assert "joint 4 yaw passes its stop at 0.000 s, at " in line and "goes 0.02 rad beyond" in line


# --- runs of any robot -----------------------------------------------------------------------


def design_of(kind, robot, motion):
    controller = CONTROLLERS[kind](omega_r=60.0)
    scenario = Scenario(plant=PlantChoice("coupled"), controller=controller, period=motion.period)
    return make_design(scenario, robot=robot, motion=motion)


@settings(max_examples=8)
@given(
    st.data(),
    robots(st.integers(1, 4)),
    st.sampled_from(["pi_id", "pi_ctc", "p_pi", "pi_scheduled"]),
    st.sampled_from([1 / 300, 0.005, 0.007]),
)
def test_recording_columns_of_any_robot_agree(data, robot, kind, period):
    motion = data.draw(motions(robot.n, period=period, samples=40))
    along = design_of("pi_id", robot, motion).tuning.feedforward.along
    need = np.abs(along).max(axis=0) * robot.gear_ratio
    weak = replace(robot, effort_limit=0.7 * need + 1e-3)
    design = design_of(kind, weak, motion)
    run, limit = simulate(design), weak.motor_torque_limit
    np.testing.assert_array_equal(run.time, np.arange(len(motion.q)) * period)
    np.testing.assert_array_equal(run.load_torque[1:], design.loads.load_torque[:-1])
    assert run.v.shape == run.saturated.shape == motion.v.shape
    share, peak = run.saturated[1:], run.tau_peak[1:] / limit
    assert share.min() >= 0 and share.max() <= 1 and peak.max() <= 1 + 1e-9
    mean, rms = np.abs(run.tau_mean[1:]) / limit, run.tau_rms[1:] / limit
    assert np.all(mean <= rms + 1e-6) and np.all(rms <= peak + 3e-3)
    np.testing.assert_array_equal(run.tau_limited, np.clip(run.tau_cmd, -limit, limit))
    np.testing.assert_allclose(mean[share >= 1], 1, atol=2e-3)
