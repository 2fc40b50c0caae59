"""How the loops are wired, what can be put into them, and what they can be built into."""

import itertools

import numpy as np
import pytest
from helpers.alone import inputs_of, outputs_of
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, InputPortIndex

from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.run.controllers import CONTROLLERS, SHIPPED
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import simulate
from sdt_drake.systems.wiring import blocks_of, systems_in

FRICTION = Friction([300.0, 60.0, 10.0, 20.0], [40.0, 0.0, 8.0, 2.0])
REAL = Drive(period=0.001, torque_bandwidth=300.0, n1=[150.0, 4, 4, 4], n0=[210.0, 5, 6, 7])

DISTURBED = {"disturbance.amplitude": 0.05}
WRONG = {
    "controller.model": Deviation(payload_mass=-40.0),
    "controller.friction_compensation": True,
    "controller.feedforward_gain": [1.1, 1, 0.9, 0],
    "plant.friction": FRICTION,
}
ONLINE = {"inverse_dynamics": "online"}
WIRINGS = [
    ("axis_pi_ctc", {}),
    ("axis_pi_ctc", ONLINE | {"controller.setpoint_weight": 1}),
    ("coupled_pi", {"controller.kind": "inverse_dynamics"}),
    ("coupled_pi", {"controller.kind": "p_pi", "controller.feedforward": "id", "drive": REAL}),
    ("coupled_pi", {"controller.kind": "pi_scheduled", "plant.friction": FRICTION}),
    ("coupled_pi_ctc", DISTURBED),
    ("coupled_pi_ctc", ONLINE),
]


SYSTEMS = [
    "reference_source", "zero_order_hold", "feedforward", "controller", "dynamic_saturation",
    "device", "encoder", "extra_load_torque",
]  # fmt: skip
APPLIED = {"actuation", "applied_generalized_force"}  # of a MultibodyPlant; it has many more


def left_over(diagram):
    """Inputs of all nested systems that are neither connected nor exported."""
    for outer in systems_in(diagram):
        if not isinstance(outer, Diagram):
            continue
        exported = range(outer.num_input_ports())
        wired = [at for i in exported for at in outer.GetInputPortLocators(InputPortIndex(i))]
        wired = {(system.get_name(), index) for system, index in (*wired, *outer.connection_map())}
        for system in outer.GetSystems():
            for name, port in inputs_of(system).items():
                optional = isinstance(system, MultibodyPlant) and name not in APPLIED
                if not optional and (system.get_name(), port.get_index()) not in wired:
                    yield f"{outer.get_name()}/{system.get_name()}: {name}"


def is_wired(design):
    """Check the systems and ports of a loop, and that no input is left over."""
    diagram = make_loop(design).diagram
    names = [system.get_name() for system in diagram.GetSystems()]
    assert [name for name in names if not name.startswith("log.")] == SYSTEMS
    assert [*left_over(diagram)] == []
    assert [*inputs_of(diagram)] == ["extra_load_torque"]
    assert [*outputs_of(diagram)] == ["reference", "state", "measured", "tau_cmd", "tau"]
    return diagram


DRIVES = [Drive(), Drive(period=0.001, encoder_resolution=[2**20] * 4)]
PLANTS = {"axis": "axis_pi", "coupled": "coupled_pi"}
KINDS = [(kind, plant) for kind in SHIPPED for plant in CONTROLLERS[kind].plants]


@pytest.mark.parametrize(("kind", "plant"), KINDS)
def test_every_loop_has_eight_systems_and_no_open_wire(designed, kind, plant):
    for drive, springs in itertools.product(DRIVES, (Elasticity(), Elasticity([40.0] * 4))):
        fields = {"controller.kind": kind, "drive": drive, "plant.elasticity": springs}
        is_wired(designed(PLANTS[plant], fields, end=0.1))


def test_loop_has_the_parts_of_its_scenario(designed, data_regression):
    """Drake's own blocks, but for the torques on line, which are called once per sample."""
    found = {}
    for number, (name, fields) in enumerate(WIRINGS):
        diagram = is_wired(designed(name, fields, end=0.1))
        own = [s for s in blocks_of(diagram) if not type(s).__module__.startswith("pydrake.")]
        assert [s.get_name() for s in own] == ["load_torque"] * ("inverse_dynamics" in fields)
        parts = {
            system.get_name(): " ".join(inner.get_name() for inner in system.GetSystems())
            for system in diagram.GetSystems()
            if isinstance(system, Diagram)
        }
        found[f"{number} {diagram.get_name()}"] = parts
    data_regression.check(found)


@pytest.mark.parametrize(("name", "fields"), [w for w in WIRINGS if "online" not in w[1].values()])
def test_loops_without_python_convert_to_autodiff(designed, name, fields):
    """And have the same derivatives there; the state is small, so that no motor saturates."""
    diagram = make_loop(designed(name, fields, start=8, end=8.1)).diagram
    converted = diagram.ToAutoDiffXd()
    context, own = converted.CreateDefaultContext(), diagram.CreateDefaultContext()
    state = np.random.default_rng(3).normal(size=own.num_continuous_states()) * 1e-4
    own.SetContinuousState(state)
    context.SetTimeStateAndParametersFrom(own)
    derivatives = converted.EvalTimeDerivatives(context).CopyToVector()
    expected = diagram.EvalTimeDerivatives(own).CopyToVector()
    np.testing.assert_allclose([d.value() for d in derivatives], expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("axis_pi_ctc", {"algorithm": "printed"}),
        ("coupled_pi_ctc", WRONG),
        ("coupled_pi", WRONG | {"controller.kind": "pi_id"}),
    ],
    ids=str,
)
def test_tabled_and_online_torques_are_the_same(designed, name, fields):
    table, online = (
        simulate(designed(name, fields | how, start=2.0, end=2.5)) for how in ({}, ONLINE)
    )
    for signal in ("v", "tau", "tau_cmd", "load_torque"):
        own, wanted = getattr(online, signal), getattr(table, signal)
        np.testing.assert_allclose(own, wanted, rtol=1e-9, atol=1e-8, err_msg=signal)


def test_run_drawn_in_meshcat_is_the_same(designed, meshcat):
    design = designed("coupled_pi", start=2.0, end=2.2)
    drawn, plain = simulate(make_loop(design, meshcat=meshcat)), simulate(design)
    np.testing.assert_array_equal(drawn.v, plain.v)
    assert meshcat.HasPath("/robot/sdt/payload")
    assert meshcat._GetPackedTransform("/robot/sdt/payload")  # where the run has left it
