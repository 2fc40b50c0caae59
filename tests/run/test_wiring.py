"""How the loops are wired, what can be put into them, and what they can be built into."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource, PassThrough

from sdt_drake.io.errors import InputError
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Drive, Friction
from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import make_simulator, simulate
from sdt_drake.systems.wiring import blocks_of

FRICTION = Friction([300.0, 60.0, 10.0, 20.0], [40.0, 0.0, 8.0, 2.0])
REAL = Drive(period=0.001, torque_bandwidth=300.0, n1=[150.0, 4, 4, 4], n0=[210.0, 5, 6, 7])

DISTURBED = {"disturbance.amplitude": 0.05}
ONLINE = {"inverse_dynamics": "online"}
WIRINGS = [
    ("axis_pi", {}),
    ("axis_pi_ctc", {}),
    ("axis_pi_ctc", ONLINE | {"controller.structure": "pi"}),
    ("coupled_pi", {}),
    ("coupled_pi", {"controller.kind": "inverse_dynamics"}),
    ("coupled_pi", {"controller.kind": "p_pi", "controller.feedforward": "id", "drive": REAL}),
    ("coupled_pi", {"controller.kind": "pi_scheduled", "plant.friction": FRICTION}),
    ("coupled_pi_ctc", DISTURBED),
    ("coupled_pi_ctc", ONLINE),
]
OF_EACH = pytest.mark.parametrize(("name", "fields"), WIRINGS, ids=range(len(WIRINGS)))


def of(diagram, root, *names):
    """A system inside, and its context."""
    for name in names:
        diagram = diagram.GetSubsystemByName(name)
    return diagram, diagram.GetMyMutableContextFromRoot(root)


# --- blocks ----------------------------------------------------------------------------------


@OF_EACH
def test_a_loop_has_the_blocks_that_its_scenario_asks_for(designed, name, fields):
    design = designed(name, fields, end=0.1)
    loop, axis = make_loop(design), name.startswith("axis")
    disturbed = design.scenario.disturbance.amplitude > 0
    expected = {"reference_source", "zero_order_hold", "controller", "dynamic_saturation"}
    expected |= {"extra_load_torque", "axis_process" if axis else "multibody_plant"}
    expected |= {"load_torque"} if axis or name.endswith("ctc") else set()
    expected |= {"disturbance"} if disturbed else set()
    expected |= {"friction"} if design.friction else set()
    expected |= {"true_load"} if axis or disturbed or design.friction else set()
    expected |= {"encoder", "torque_loop"} if design.drive.period else set()
    expected |= {"position_encoder"} if loop.controller.HasInputPort("sampled_state") else set()
    names = {system.get_name() for system in loop.GetSystems()}
    assert {n for n in names if not n.startswith("log.")} == expected
    assert loop.get_name() == ("axis_loop" if axis else "coupled_loop")
    inputs = [loop.get_input_port(i).get_name() for i in range(loop.num_input_ports())]
    outputs = [loop.get_output_port(i).get_name() for i in range(loop.num_output_ports())]
    assert inputs == ["extra_load_torque"]
    assert outputs == ["reference", "state", "measured", "tau_cmd", "tau"]


@OF_EACH
def test_no_python_in_the_derivatives(designed, name, fields):
    """Every system inside is Drake's own; but for the torques of the reference on line, which are
    called once per sample (test_online_torque)."""
    own = {
        system.get_name()
        for system in blocks_of(make_loop(designed(name, fields, end=0.1)))
        if not type(system).__module__.startswith("pydrake.")
    }
    assert own == ({"load_torque"} if "inverse_dynamics" in fields else set())


@pytest.mark.parametrize(("name", "fields"), [w for w in WIRINGS if "online" not in w[1].values()])
def test_loops_without_python_convert_to_autodiff(designed, name, fields):
    """And have the same derivatives there; the state is small, so that no motor saturates."""
    diagram = make_loop(designed(name, fields, start=8, end=8.1))
    converted = diagram.ToAutoDiffXd()
    context, own = converted.CreateDefaultContext(), diagram.CreateDefaultContext()
    state = np.random.default_rng(3).normal(size=own.num_continuous_states()) * 1e-4
    own.SetContinuousState(state)
    context.SetTimeStateAndParametersFrom(own)
    derivatives = converted.EvalTimeDerivatives(context).CopyToVector()
    np.testing.assert_allclose(
        [d.value() for d in derivatives],
        diagram.EvalTimeDerivatives(own).CopyToVector(),
        rtol=1e-9,
        atol=1e-9,
    )


@pytest.mark.parametrize("fields", [{}, ONLINE], ids=["table", "online"])
@pytest.mark.parametrize("name", ["axis_pi_ctc", "coupled_pi_ctc"])
def test_no_sample_of_delay(designed, name, fields):
    """From its own instant on, a sample of the reference is in force, and its load with it."""
    design = designed(name, fields | DISTURBED, start=8.5, end=9.0)
    motion, load = design.motion, design.loads.load_torque
    # A sample too late would show: the first row is not zero, and no row is like the one before.
    assert np.abs(load[0]).max() > 10
    assert np.abs(np.diff(load, axis=0)).max(axis=1).min() > 0.01
    diagram = make_loop(design)
    simulator = make_simulator(diagram, period=motion.period, accuracy=1e-4)
    simulator.Initialize()
    root = simulator.get_context()
    process = "axis_process" if name.startswith("axis") else "multibody_plant"
    for i in range(len(motion.q) - 1):
        simulator.AdvanceTo(i * motion.period + 0.001)
        reference = diagram.GetOutputPort("reference").Eval(root)
        np.testing.assert_array_equal(reference, [*motion.q[i], *motion.v[i], *motion.vd[i]])
        controller, own = of(diagram, root, "controller")
        tau_ff = controller.GetInputPort("load_torque").Eval(own)
        np.testing.assert_allclose(tau_ff, load[i], rtol=1e-9, atol=1e-9)
        loaded, own = of(diagram, root, process)
        share = 0.05 * np.sin(2 * np.pi * root.get_time()) + name.startswith("axis")
        true = loaded.GetInputPort("load_torque").Eval(own)
        np.testing.assert_allclose(true, share * load[i], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("axis_pi_ctc", {"algorithm": "printed"}),
        ("coupled_pi_ctc", {}),
        ("coupled_pi", {"controller.kind": "pi_id"}),
        *(
            (
                "coupled_pi",
                {
                    "controller.kind": kind,
                    "controller.model": Deviation(payload_mass=mass),
                    "controller.friction_compensation": True,
                    "controller.feedforward_gain": [1.1, 1, 0.9, 0],
                    "plant.friction": FRICTION,
                },
            )
            for kind in ("pi_ctc", "pi_id")
            for mass in (0.0, -40.0)
        ),
    ],
    ids=str,
)
def test_table_and_online_torques_are_the_same(run, name, fields):
    table, online = (run(name, fields | how, start=2.0, end=2.5) for how in ({}, ONLINE))
    for signal in ("v", "tau", "tau_cmd", "load_torque"):
        np.testing.assert_allclose(
            getattr(online, signal), getattr(table, signal), rtol=1e-9, atol=1e-8, err_msg=signal
        )


# --- one's own -------------------------------------------------------------------------------


class Own(LeafSystem):
    """tau_cmd = gain (v_ref - v), in Python; knows nothing of the package."""

    def __init__(
        self, gain, *, reference=12, state=("state", 8), output=("tau_cmd", 4), further=()
    ):
        super().__init__()
        ports = ("reference", reference), state
        self.ports = [self.DeclareVectorInputPort(*port) for port in ports]
        self.gain = gain
        for each in (output, further)[: 1 + bool(further)]:
            self.DeclareVectorOutputPort(*each, self.calc)

    def calc(self, context, output):
        reference, state = (port.Eval(context) for port in self.ports)
        output.SetFromVector(self.gain * (reference[4:8] - state[4:]))


@pytest.mark.parametrize(
    ("ports", "message"),
    [
        ({"state": ("speed", 8)}, r"^controller \(class Own\): an input 'speed', expected "),
        ({"state": ("state", 4)}, "^controller: input 'state' has length 4, expected 8$"),
        (
            {"output": ("torque", 4)},
            r"^controller \(class Own\): outputs: torque of length 4, expected tau_cmd",
        ),
        (
            {"output": ("tau_cmd", 3)},
            "^controller .*: .*tau_cmd of length 3, expected tau_cmd of",
        ),
        ({"further": ("reference", 12)}, "^controller .*: .*tau_cmd of length 4, reference of"),
    ],
    ids=str,
)
def test_ports_that_do_not_fit_are_refused(designed, ports, message):
    with pytest.raises(InputError, match=message) as error:
        make_loop(designed("coupled_pi", end=0.1), controller=Own(1.0, **ports))
    assert "\n" not in str(error.value)


def test_drawn_in_meshcat_a_run_is_the_same(designed, meshcat):
    design = designed("coupled_pi", start=2.0, end=2.2)
    drawn = simulate(design, make_loop(design, meshcat=meshcat), realtime_rate=0.0)
    np.testing.assert_array_equal(drawn.v, simulate(design).v)
    assert meshcat.HasPath("/robot/sdt/payload")
    assert meshcat._GetPackedTransform("/robot/sdt/payload")


def test_a_loop_inside_a_diagram_of_ones_own_is_the_same(designed):
    """Found, however deep, started in equilibrium and recorded; what it gives out can be used."""
    design = designed("coupled_pi_ctc", {"plant.friction": FRICTION}, start=2.0, end=2.3)
    builder = DiagramBuilder()
    loop = builder.AddSystem(make_loop(design))
    none = builder.AddSystem(ConstantVectorSource(np.zeros(4)))
    seen = builder.AddSystem(PassThrough(8))
    builder.Connect(none.get_output_port(), loop.GetInputPort("extra_load_torque"))
    builder.Connect(loop.GetOutputPort("state"), seen.get_input_port())
    around = DiagramBuilder()
    around.AddSystem(builder.Build())
    inside, alone = simulate(design, around.Build()), simulate(design)
    for name in ("v", "tau", "tau_peak"):
        np.testing.assert_allclose(
            getattr(inside, name), getattr(alone, name), rtol=1e-9, atol=1e-9, err_msg=name
        )


def test_diagrams_without_the_loop_of_the_design_are_refused(designed):
    design, other = designed("coupled_pi", end=0.1), designed("axis_pi", end=0.1)

    def with_loops(*loops):
        builder = DiagramBuilder()
        for k, loop in enumerate([PassThrough(1), *loops]):
            builder.AddNamedSystem(f"part_{k}", loop)
        return builder.Build()

    bad = [with_loops(), with_loops(make_loop(other)), make_loop(other)]
    bad.append(with_loops(make_loop(design), make_loop(design)))
    for diagram in bad:
        with pytest.raises(InputError, match=r"^diagram: .*expected the loop of the design or a"):
            simulate(design, diagram)
