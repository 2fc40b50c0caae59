"""The code that an FMU runs. The script in each FMU derives its class from `LoopSlave`."""

import ctypes
import json
import sys
from dataclasses import replace
from functools import partial
from operator import itemgetter, setitem
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.versions import versions
from sdt_drake.io.yaml_files import read_yaml
from sdt_drake.machine.fmu import ABOUT, SCENARIO, open_loop
from sdt_drake.pilot.head import has_head, head_motion
from sdt_drake.robot.device import Friction, friction_parameters
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import make_simulator

_INPUTS = {"torque": ("tau_cmd",), "reference": ("q_ref", "v_ref", "vd_ref")}

_MEANINGS = read_yaml(Path(__file__).with_name("fmu_variables.yaml"))

_SAME_TIME = 1e-6  # [periods] distance between a sample and a time that means it


def give_reference(*objects: Any) -> None:
    """Give away a reference to each object.

    PythonFMU up to 0.7 releases references that it does not own: to the globals of the script at
    each instance, and to the instance, its class and its messages at each error.
    """
    for one in objects:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(one))


def _changed(friction: Friction, viscous: Array, coulomb: Array) -> Friction:
    """Return friction with other viscous and Coulomb parts; breakaway changes with the latter."""
    own = friction_parameters(friction, len(coulomb))
    share = np.divide(coulomb, own.coulomb, out=np.ones_like(coulomb), where=own.coulomb > 0)
    breakaway = np.maximum(share * own.breakaway, coulomb)
    b, f_c, f_b = (x.tolist() if x.any() else None for x in (viscous, coulomb, breakaway))
    return replace(friction, viscous=b, coulomb=f_c, breakaway=f_b)


class LoopSlave(Fmi2Slave):  # type: ignore[misc]  # pythonfmu has no types
    """A loop on the coupled plant whose reference or torque command is an input.

    The loop starts at time 0, at rest, and takes steps of any size. Vectors have a variable for
    each joint, `q[1]`: joint side, but motor side for torques.
    """

    def __init__(self, **instance: Any) -> None:
        super().__init__(**instance)
        folder = Path(self.resources)
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
        here, made = versions()["package"], about["version"]
        if here != made:
            raise InputError(f"sdt_drake {here}, expected {made}, the version that wrote the FMU")
        self._given = about["inputs"]
        self._scenario = load_scenario(folder / SCENARIO)
        self._design = design = make_design(self._scenario)
        self._names, n = _INPUTS[self._given], design.device.simulated.n
        name = "".join(c if c.isalnum() else "_" for c in design.scenario.name)
        self.modelName = f"sdt_{name}"
        self.description = f"{design.scenario.name}: the loop of sdt_drake {here}"
        self.default_experiment = DefaultExperiment(
            0.0, design.reference.tracked.duration, self._period
        )

        first = design.reference.tracked.q[0]
        friction = friction_parameters(self._scenario.plant.friction, n)
        self._parameters = {
            "payload_mass": np.array([self._scenario.plant.deviation.payload_mass]),
            "viscous_friction": np.array(friction.viscous),
            "coulomb_friction": np.array(friction.coulomb),
            "q_start": np.array(first),
        }
        start = {"q_ref": first, "v_ref": np.zeros(n), "vd_ref": np.zeros(n)}
        self._inputs = {name: np.array(start.get(name, np.zeros(n))) for name in self._names}
        self._outputs = {name: np.zeros(n) for name in ("q", "v", "tau")}
        if has_head(design.device.simulated):
            self._outputs |= {"specific_force": np.zeros(3), "angular_rate": np.zeros(3)}
        fixed = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}
        self._register(self._parameters, **fixed)
        self._register(self._inputs, causality=Fmi2Causality.input)
        self._register(self._outputs, causality=Fmi2Causality.output)

    def _register(self, vectors: dict[str, Array], **kind: Any) -> None:
        for name, values in vectors.items():
            for k in range(len(values)):
                self.register_variable(
                    Real(
                        f"{name}[{k + 1}]" if len(values) > 1 else name,
                        getter=partial(itemgetter(k), values),
                        setter=partial(setitem, values, k),
                        description=_MEANINGS[name],
                        **kind,
                    ),
                    nested=False,
                )

    def to_xml(self, *options: Any) -> Element:
        root: Element = super().to_xml(*options)
        structure = root.find("ModelStructure")
        assert structure is not None
        # FMI 2.0.4, 2.2.8: outputs without a start value are unknowns of the initialization.
        initial = SubElement(structure, "InitialUnknowns")
        initial.extend(structure.findall("Outputs/Unknown"))
        return root

    @property
    def _period(self) -> float:
        return self._design.reference.held.period

    # --- called by the other simulator -----------------------------------------------------------

    def setup_experiment(
        self, start: float, stop: float | None = None, tolerance: float | None = None
    ) -> None:
        if start != 0:
            self._fail(f"start time {start:g} s, expected 0")

    def exit_initialization_mode(self) -> None:
        try:
            self._check_finite(self._parameters | self._inputs)
            self._begin()
        except InputError as error:
            self._fail(f"{error}")

    def _fail(self, problem: str) -> None:
        """Let the call of the other simulator fail.

        The text is also written to stderr, since PythonFMU gives it to simulators only with
        debug logging.
        """
        sys.stderr.write(f"{self.instance_name}: {problem}\n")
        give_reference(self, type(self), self.log_queue)
        raise InputError(problem)

    def _begin(self) -> None:
        """Build the loop with the parameters and start it at rest."""
        parameters, friction = self._parameters, self._scenario.plant.friction
        b, f_c = parameters["viscous_friction"], parameters["coulomb_friction"]
        changes = {
            "plant.deviation.payload_mass": parameters["payload_mass"][0],
            "plant.friction": _changed(friction, b, f_c),
        }
        design = make_design(self._scenario.changed(changes), motion=self._design.reference.planned)
        self._loop = open_loop(design, self._given)
        self._simulator = make_simulator(
            self._loop.diagram,
            period=self._period,
            accuracy=design.scenario.accuracy,
            simulation=design.scenario.simulation,
        )
        self._context = self._simulator.get_mutable_context()
        self._feed()
        self._loop.set_steady_state(self._context, q=self._parameters["q_start"])
        self._simulator.Initialize()
        self._read()

    def do_step(self, current_time: float, step_size: float) -> bool:
        try:
            self._check_finite(self._inputs)
        except InputError as error:
            self._fail(f"{error}")
        self._feed()
        periods = (self._context.get_time() + step_size) / self._period
        if abs(periods - round(periods)) < _SAME_TIME:
            periods = round(periods)  # exactly the time of the sample
        self._simulator.AdvanceTo(periods * self._period)
        self._read()
        return True

    def _check_finite(self, vectors: dict[str, Array]) -> None:
        for name, values in vectors.items():
            if not np.isfinite(values).all():
                raise InputError(f"{values.tolist()}, expected finite numbers", place=name)

    def _feed(self) -> None:
        port = self._loop.GetInputPort("tau_cmd" if len(self._names) == 1 else "reference")
        port.FixValue(self._context, np.concatenate([self._inputs[x] for x in self._names]))

    def _signal(self, name: str) -> Array:
        return np.array(self._loop.diagram.GetOutputPort(name).Eval(self._context))

    def _read(self) -> None:
        n, outputs = self._design.device.simulated.n, self._outputs
        outputs["q"][:], outputs["v"][:] = np.split(self._signal("measured"), 2)
        outputs["tau"][:] = self._signal("tau")
        if "specific_force" not in outputs:
            return
        q, v = np.split(self._signal("state"), 2)
        device = self._loop.diagram.GetSubsystemByName("device")  # the plant's state is its first
        own = device.GetMyContextFromRoot(self._context)
        rates = device.EvalTimeDerivatives(own).CopyToVector()
        head = head_motion(
            self._loop.design.device.simulated, *(x[None] for x in (q, v, rates[n : 2 * n]))
        )
        outputs["specific_force"][:] = head.specific_force[0]
        outputs["angular_rate"][:] = head.angular_velocity[0]
