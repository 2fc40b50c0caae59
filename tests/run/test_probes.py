"""Probes: outputs of blocks beside the signals of a run, in memory, in files and on its page."""

import numpy as np
import pytest
import scipy.io

from sdt_drake import systems
from sdt_drake.io.errors import InputError
from sdt_drake.run.loop import make_loop
from sdt_drake.run.probes import output_ports
from sdt_drake.run.recording import Recording
from sdt_drake.run.simulate import simulate
from sdt_drake.show.reports.run import run_report

RECORDED = ("q", "v", "tau_cmd", "tau_limited", "tau", "tau_mean", "tau_rms", "saturated")
ELASTIC = {
    "plant.elasticity.natural_frequency": [65.0, 0.0, 65.0, 0.0],
    "plant.friction.viscous": [500.0] * 4,
    "disturbance.amplitude": 0.05,
}
NAMES = ["tau_fb", "tau_ff", "load_torque", "device.elastic_joints.deflection", "friction"]


@pytest.fixture(scope="module")
def elastic(designed):
    return designed("coupled_pi_ctc", ELASTIC, start=0.5, end=0.65)


@pytest.fixture(scope="module")
def probed(elastic):
    return simulate(elastic, probes=[*NAMES, "tau_link", "disturbance", "device.state"])


def test_probes_are_the_terms_of_the_recorded_signals_at_each_sample(elastic, probed):
    probes = probed.probes
    np.testing.assert_array_equal(probes["tau_fb"] + probes["tau_ff"], probed.tau_cmd)
    np.testing.assert_array_equal(probes["device.state"], np.hstack([probed.q, probed.v]))
    wound = probes["device.elastic_joints.deflection"]
    np.testing.assert_allclose(wound, probed.q_measured - probed.q, rtol=0, atol=1e-15)
    sine = 0.05 * np.sin(2 * np.pi * probed.time[:, None])
    np.testing.assert_allclose(
        probes["disturbance"], sine * probes["load_torque"], rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(
        probes["friction"], 500 * probed.v / elastic.nominal.gear_ratio, rtol=1e-12
    )
    np.testing.assert_array_equal(probes["tau_link"][:, [1, 3]], probed.tau[:, [1, 3]])


def test_a_run_with_probes_is_the_run_without_them(elastic, probed):
    plain = simulate(elastic)
    assert plain.probes == {}
    for name in RECORDED:
        np.testing.assert_array_equal(getattr(probed, name), getattr(plain, name))


@pytest.mark.parametrize("period", [0.005, 0.001])
def test_rows_of_a_probe_are_those_before_the_updates_the_first_one_after(designed, period):
    """A drive measures at its samples, so at the end of a period it holds the last sample."""
    fields = {"drive.period": period, "probes": "encoder.drives.measured"}
    run = simulate(designed("coupled_pi", fields, start=0.5, end=0.7))
    held, state = run.probes["encoder.drives.measured"], np.hstack([run.q, run.v])
    np.testing.assert_array_equal(held[0], state[0])
    if period == 0.005:
        np.testing.assert_array_equal(held[1:], state[:-1])
    else:
        late = run.q[1:] - held[1:, :4]
        np.testing.assert_allclose(late, period * run.v[1:], atol=2e-5)


@pytest.mark.parametrize("suffix", [".csv", ".mat", ".parquet"])
def test_a_file_keeps_probes_and_states_their_units(probed, tmp_path, suffix):
    probed.save(path := tmp_path / f"run{suffix}")
    again = Recording.load(path)
    assert again.probes.keys() == probed.probes.keys()
    for name, values in probed.probes.items():
        np.testing.assert_array_equal(again.probes[name], values)
    if suffix == ".mat":
        units = scipy.io.loadmat(path, simplify_cells=True)["units"]["probes"]
        assert units["tau_fb"] == "N m" and units["device"]["state"] == "rad, rad/s"
        assert units["device"]["elastic_joints"] == {"deflection": "rad"}
    if suffix == ".parquet":
        schema = pytest.importorskip("pyarrow.parquet").read_schema(path)
        units = {field.name: (field.metadata or {}).get(b"unit") for field in schema}
        assert units["probes.tau_fb_4"] == b"N m" and units["tau_1"] is None
        state = [units[f"probes.device.state_{k}"] for k in (4, 5)]
        assert state == [b"rad", b"rad/s"]


def test_the_name_of_a_signal_is_its_outermost_port_and_every_path_is_found(elastic):
    loop = make_loop(elastic)
    ports = output_ports(loop.diagram)
    assert {"controller.tau_fb", "controller.pi_speed_controller.tau_fb"} <= ports.keys()
    run = simulate(loop, probes=[*ports, "tau_fb"])
    np.testing.assert_array_equal(run.probes["tau_fb"], run.probes["controller.tau_fb"])
    assert {name: values.shape[1] for name, values in run.probes.items() if name in ports} == {
        name: port.size() for name, port in ports.items()
    }


@pytest.mark.parametrize(
    ("probe", "said"),
    [
        ("tau_fbb", r"^probes\[1\]: 'tau_fbb': no port of the loop, did you mean 'tau_fb'"),
        ("device.fricton.friction", "did you mean 'device.friction.friction'"),
        ("zzzzz", r"no port of the loop, expected a port that sdt-drake diagram can list$"),
        ("y0", r"one of several: .*, expected a longer path$"),
        (3, r"probes\[1\]: 3, expected a text"),
    ],
)
def test_a_probe_that_names_no_port_is_told_with_the_nearest(elastic, probe, said):
    with pytest.raises(InputError, match=said):
        simulate(elastic, probes=[probe])


def test_units_of_ports_are_those_of_the_table_of_signals():
    states = dict.fromkeys(("state", "motor_state", "measured", "sampled_state"), "rad, rad/s")
    torques = ("tau_fb", "tau_ff", "tau_cmd", "tau_limited", "tau", "load_torque", "disturbance")
    torques += ("alleviating_torque", "friction", "tau_link", "stop_torque", "gear_loss", "ripple")
    expected = dict.fromkeys(torques, "N m") | states | {"inertia_share": "-", "deflection": "rad"}
    expected |= dict.fromkeys(("reference", "speed_reference"), "rad, rad/s, rad/s²")
    assert expected.items() <= systems.UNITS.items()


def test_the_page_of_a_run_shows_a_panel_for_each_unit_of_a_probe(elastic, probed, tmp_path):
    report = run_report(elastic, probed, tmp_path / "run.md", [0])
    (section,) = (section for section in report.sections if section.title == "Probes")
    panels = {picture.caption: picture.content.columns[0] for picture in section.blocks}
    assert len(panels) == len(probed.probes)
    positions, speeds = panels["The probe device.state."]
    assert positions.y_label == "device.state [rad]" and speeds.y_label == "device.state [rad/s]"
    np.testing.assert_array_equal(speeds.lines[3].values, probed.v[:, 3])
