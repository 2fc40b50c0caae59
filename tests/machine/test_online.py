"""Cueing of a flight as it comes: limits, stops, its state, what it loses, and a flight by UDP."""

import gc
import socket
import weakref
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.command_line import ARM, JOINT, LINK
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

import sdt_drake as sdt
from sdt_drake.machine.cueing import online, procedure
from sdt_drake.machine.cueing.candidate import Candidate, percept_of
from sdt_drake.machine.cueing.flight import make_flight, read_flight
from sdt_drake.machine.cueing.online import LAWS, OnlineCueing
from sdt_drake.machine.cueing.online_flight import run_online
from sdt_drake.machine.cueing.search import is_within
from sdt_drake.machine.cueing.udp import UdpFlight
from sdt_drake.pilot import load_perception
from sdt_drake.pilot.head import GRAVITY, head_motion
from sdt_drake.systems.reference import sample_source

LEVEL = np.array([0.0, 0.0, GRAVITY])


def steady(force, seconds):
    """A flight of constant force [m/s²] without rotation."""
    time = np.arange(0, seconds + 0.01, 0.1)
    return make_flight(time, np.tile(force, (len(time), 1)), np.zeros((len(time), 3)))


@pytest.fixture(scope="module")
def roll_in():
    """Nine seconds of the shipped turn, from 1 to 2 G."""
    flight = read_flight("turn")
    own = (flight.time >= 5) & (flight.time <= 14)
    return make_flight(flight.time[own], flight.specific_force[own], flight.angular_rate[own])


@pytest.fixture(scope="module")
def runs(robot, roll_in):
    up = roll_in.specific_force[0]
    return {law: run_online(OnlineCueing(robot, law=law, sense=-1, up=up), roll_in) for law in LAWS}


@pytest.mark.parametrize("law", LAWS)
def test_motion_keeps_all_limits_and_stops_when_the_flight_is_silent(runs, law, robot, roll_in):
    run = runs[law]
    assert is_within(robot, run.motion, 0.95)
    assert np.abs(run.motion.v[0]).max() > 1.9 and np.all(run.motion.v[-1] == 0)  # 1.4 G at first
    assert run.motion.duration < roll_in.duration + 3 + 16  # a plan, and the longest stop
    assert not run.is_kept.any() and len(run.computing_share) == 44


def test_program_is_felt_nearer_than_the_washout_within_the_same_limits(runs, robot, roll_in):
    model = load_perception("slow_yaw")
    time = np.arange(0, roll_in.duration, 0.02)
    felt = percept_of(model, time, *roll_in.at(time))
    program, washout = (
        Candidate(law, robot, runs[law].motion, roll_in, 0.0, model).errors(felt) for law in LAWS
    )
    assert program[1] < 0.5 * washout[1] and program[2] < 0.5 * washout[2]


def test_washout_of_a_steady_force_ends_at_that_force(robot):
    force = 1.5 * GRAVITY * np.array([0.3, 0.0, np.sqrt(1 - 0.3**2)])
    run = run_online(OnlineCueing(robot, law="washout"), steady(force, 14.0))
    last = round(14.0 / run.motion.period)
    head = head_motion(
        robot, *(x[last : last + 1] for x in (run.motion.q, run.motion.v, run.motion.vd))
    )
    np.testing.assert_allclose(head.specific_force[0], force, atol=0.02 * GRAVITY)


def test_mirrored_flight_gives_the_mirrored_motion(robot, roll_in):
    """The pilot then looks the other way along the arm's circle: the last angle is pi - q."""
    own = roll_in.time < 2
    time, force, rate = (
        getattr(roll_in, x)[own] for x in ("time", "specific_force", "angular_rate")
    )
    left = make_flight(time, force * [1, -1, 1], rate * [-1, 1, -1])
    one, other = (
        run_online(OnlineCueing(robot, sense=sense, seat=seat, up=x.specific_force[0]), x).motion.q
        for sense, seat, x in ((-1, 0.0, make_flight(time, force, rate)), (1, np.pi, left))
    )
    np.testing.assert_allclose(other, [0, 0, 0, np.pi] + one * [-1, 1, -1, -1], atol=1e-5)


@pytest.mark.parametrize("odd", [np.nan, 1e200])
def test_input_that_is_no_flight_stops_the_device_and_a_flight_starts_it_again(robot, odd):
    level = np.concatenate([LEVEL, np.zeros(3)])
    pause = np.vstack([level, level, level + odd, level + odd, level, level])
    builder = DiagramBuilder()
    source = builder.AddSystem(sample_source(np.array([0, 0.5, 0.501, 9.0, 9.001, 12.0]), pause))
    cueing = builder.AddSystem(OnlineCueing(robot, law="washout", idle_g=1.01))
    builder.Connect(source.get_output_port(), cueing.get_input_port())
    simulator = Simulator(builder.Build())
    own = cueing.GetMyContextFromRoot(simulator.get_context())
    found = {}
    for time in (0.45, 0.75, 8.9, 11.9):
        simulator.AdvanceTo(time)
        speed = cueing.GetOutputPort("reference").Eval(own)[4:8]
        found[time] = cueing.GetOutputPort("is_kept").Eval(own)[0], np.abs(speed).max()
    assert [kept for kept, _ in found.values()] == [0, 1, 1, 0]
    assert found[0.75][1] > 0.1 and found[8.9][1] < 1e-9 < found[11.9][1]


def test_motion_lasts_as_long_as_the_flight_where_the_device_is_at_rest(robot):
    """In level flight it has nothing to do; errors are those of the whole flight all the same."""
    ends, flight = np.ones(4), steady(LEVEL, 2.0)
    bound = replace(robot, position_lower=-ends, position_upper=ends)
    run = run_online(OnlineCueing(bound, law="washout"), flight)
    still = Candidate("still", bound, run.motion, flight, 0.0, load_perception("slow_yaw"))
    assert run.motion.duration >= 2.0 and still.g_error < 0.02
    assert len(still.force_error[still.within]) == round(2.0 / run.motion.period) + 1


def test_plans_beyond_the_limits_are_not_taken_and_the_device_stops(robot, monkeypatch):
    """Plans with 10 rad/s more, beyond the limit of every joint."""
    monkeypatch.setattr(online, "solve", lambda problem, start, *_: replace(start, v=start.v + 10))
    run = run_online(OnlineCueing(robot, law="washout"), steady(1.4 * LEVEL, 13.0))
    assert run.is_kept.all() and is_within(robot, run.motion, 0.95)
    assert np.abs(run.motion.v[run.motion.time > 12]).max() < 1e-9


def test_all_state_is_in_the_context(robot, roll_in):
    builder = DiagramBuilder()
    samples = np.hstack([roll_in.specific_force, roll_in.angular_rate])
    source = builder.AddSystem(sample_source(roll_in.time, samples))
    cueing = builder.AddNamedSystem("cueing", OnlineCueing(robot, law="washout"))
    builder.Connect(source.get_output_port(), cueing.get_input_port())
    diagram = builder.Build()
    first = Simulator(diagram)
    first.AdvanceTo(1.0)
    second = Simulator(diagram, first.get_context().Clone())
    ends = []
    for simulator in (first, second):
        simulator.AdvanceTo(2.0)
        own = cueing.GetMyContextFromRoot(simulator.get_context())
        ends.append(cueing.GetOutputPort("reference").Eval(own))
    np.testing.assert_array_equal(*ends)
    assert np.abs(ends[0][4:8]).max() > 0.1


def test_block_drives_the_reference_port_of_the_loop_and_is_freed(robot, roll_in):
    samples = np.hstack([roll_in.specific_force, roll_in.angular_rate])
    motion = sdt.Motion.from_speeds(0.005, np.zeros(4), np.zeros((121, 4)))
    scenario = sdt.load("coupled_pi_ctc", {"inverse_dynamics": "online"})
    loop = sdt.loop(sdt.design(scenario, motion=motion), reference="external")
    cueing = OnlineCueing(robot, law="washout")
    builder = DiagramBuilder()
    source = builder.AddSystem(sample_source(roll_in.time, samples))
    for system in (cueing, loop.diagram):
        builder.AddSystem(system)
    builder.Connect(source.get_output_port(), cueing.get_input_port())
    builder.Connect(cueing.GetOutputPort("reference"), loop.GetInputPort("reference"))
    q, v = cueing.start
    cueing.set_name("cueing")
    run = sdt.simulate(loop, builder.Build(), q=q, v=v, probes=["cueing.is_kept"])
    assert np.abs(run.speed_error).max() < 0.05 and run.v[-1, 0] == pytest.approx(v[0], rel=0.1)
    np.testing.assert_array_equal(run.probes["cueing.is_kept"][[0, -1], 0], [1, 0])
    block = weakref.ref(cueing)
    del cueing, builder, system, loop, source
    gc.collect()
    assert block() is None


def test_device_without_an_endless_arm_begins_at_rest_and_keeps_its_stops(robot, roll_in):
    ends = np.radians([30.0, 20.0, 20.0, 40.0])
    bound = replace(robot, position_lower=-ends, position_upper=ends)
    cueing = OnlineCueing(bound, law="washout")
    assert cueing.idle_g == 1 and np.all(cueing.start[1] == 0)
    run = run_online(cueing, roll_in)
    assert np.abs(run.motion.q).max(axis=0)[1] > np.radians(5) and is_within(
        bound, run.motion, 0.95
    )


@pytest.mark.parametrize(
    "options, message",
    [
        ({"idle_g": 9.0}, "idle_g: 9 G, expected a resultant that sdt can hold"),
        ({"idle_g": 0.5}, "idle_g: 0.5 G, expected 1 to 10 G"),
        ({"sense": 0}, "sense: 0, expected 1 or -1"),
        ({"law": "none"}, "law: 'none'"),
        ({"knot": 0.0123}, "knot: "),
        ({"knot": 3.0}, "knot: 3 s, expected at most 1 s"),
        ({"up": [1.0, 2.0]}, "up: "),
        ({"perception": "nobody"}, "nobody"),
    ],
)
def test_wrong_option_is_refused(robot, options, message):
    with pytest.raises(sdt.InputError, match=message):
        OnlineCueing(robot, **options)


def test_device_of_one_joint_is_refused(tmp_path):
    text = LINK.format(name="seat", pose="") + "<frame name='head' attached_to='seat'/>"
    text += JOINT.format(name="yaw", pose="", parent="world", child="seat")
    path = tmp_path / "one.sdf"
    path.write_text(f"{ARM[: ARM.index('<link')]}{text}</model></sdf>", encoding="utf-8")
    with pytest.raises(sdt.InputError, match=r"one\.sdf: 1 joint, expected at least 2"):
        OnlineCueing(str(path))


@pytest.mark.parametrize("start, tolerance", [(100.0, 1e-7), (100.05, 0.5)])
def test_run_from_a_later_time_gives_the_same_reference(robot, start, tolerance):
    """Between plans the reference waits for the next; by then the block knows the flight."""
    ends = []
    for began in (0.0, start):
        builder = DiagramBuilder()
        cueing = OnlineCueing(robot, law="washout")
        builder.AddSystem(cueing)
        level = builder.AddSystem(ConstantVectorSource([*LEVEL, 0.0, 0.0, 0.0]))
        builder.Connect(level.get_output_port(), cueing.get_input_port())
        simulator = Simulator(builder.Build())
        simulator.get_mutable_context().SetTime(began)
        own = cueing.GetMyContextFromRoot(simulator.get_context())
        first = 0.2 * np.ceil(began / 0.2 - 1e-9)
        for time in (first - 0.004, first + 0.702):
            simulator.AdvanceTo(max(time, began))
            ends.append(cueing.GetOutputPort("reference").Eval(own))
    np.testing.assert_allclose(ends[2:], ends[:2], atol=tolerance)
    assert np.linalg.norm(ends[1] - ends[0]) > 0.1


def test_device_that_cannot_hold_the_resultant_begins_at_rest_unless_told(robot):
    up = [0.0, 0.0, -1.0]
    cueing = OnlineCueing(robot, up=up, torque_margin=0.1)
    assert cueing.idle_g == 1 and np.all(cueing.start[1] == 0)
    with pytest.raises(sdt.InputError, match=r"idle_g: 1\.4 G, expected a resultant"):
        OnlineCueing(robot, up=up, torque_margin=0.1, idle_g=1.4)


def test_flight_shorter_than_the_time_between_plans_has_one_plan(robot):
    run = run_online(OnlineCueing(robot, law="washout"), steady(LEVEL, 0.1))
    assert len(run.computing_share) == len(run.is_kept) == 1


def test_fly_refuses_a_resultant_before_the_search(robot, monkeypatch):
    monkeypatch.setattr(procedure, "_problem_of", lambda *_: pytest.fail("searched"))
    with pytest.raises(sdt.InputError, match="idle_g: 9 G, expected a resultant that sdt can hold"):
        procedure.fly(robot, steady(LEVEL, 1.0), idle_g=9.0, online=True)


def test_datagrams_without_end_do_not_hold_the_run(monkeypatch):
    flight = UdpFlight()
    endless = SimpleNamespace(recv=lambda _: b"0, 1, 2, 3, 4, 5, 6")
    monkeypatch.setattr(flight, "_socket", endless)
    simulator = Simulator(flight)
    simulator.AdvanceTo(0.001)
    assert flight.GetOutputPort("flight").Eval(simulator.get_context()).tolist() == [*range(1, 7)]


@pytest.fixture
def sender():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        yield sender


def test_newest_datagram_counts_and_silence_is_no_flight(sender):
    flight = UdpFlight(columns="jsbsim", silence=0.1)
    simulator = Simulator(flight)
    context = simulator.get_context()

    def after(time, *lines):
        for line in lines:
            sender.sendto(line, ("127.0.0.1", flight.port))
        simulator.AdvanceTo(time)
        return flight.GetOutputPort("flight").Eval(context).tolist()

    assert after(0.5) == [0, 0, GRAVITY, 0, 0, 0]  # also a long time before the first one
    one, two = b"0.1, 1, 1, 1, 1, 1, 1\n", b"0.2, 10, 20, -30, 0.1, 0.2, 0.3\n"
    ft = 0.3048  # of JSBSim, whose y is to the right and z down
    told = [10 * ft, -20 * ft, 30 * ft, 0.1, -0.2, -0.3]
    assert after(0.51, b"<LABELS> , Time, a, b, c, p, q, r\n", one, two) == pytest.approx(told)
    bad = b"1,2,3\n", b"0.3, 1, 1, 1, nan, 1, 1", b"\xff\xff", b"0.3, 1, 1, 1, 1, 1, 1e999"
    assert after(0.55, *bad) == pytest.approx(told)
    assert flight.GetOutputPort("refused").Eval(context)[0] == len(bad)
    assert np.isnan(after(0.7)).all()
    assert after(0.71, two) == pytest.approx(told)
    with pytest.raises(sdt.InputError, match=f"port: {flight.port} cannot be opened: "):
        UdpFlight(flight.port)
    with pytest.raises(sdt.InputError, match="port: 99999 cannot be opened: "):
        UdpFlight(99999)


def test_port_is_free_again_when_the_block_is_dropped():
    port = UdpFlight().port
    gc.collect()
    assert UdpFlight(port).port == port
