"""What costs much is made once for all tests, by whichever of pytest's processes needs it first."""

from __future__ import annotations

import copy
import fcntl
import functools
import hashlib
import pickle
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from importlib import import_module

import numpy as np

from sdt_drake.io import yaml_files
from sdt_drake.io.resources import PACKAGE_PREFIX
from sdt_drake.io.yaml_files import yaml_text
from sdt_drake.robot.motors import as_driven
from sdt_drake.run.loop import Loop, make_loop
from sdt_drake.systems.wiring import blocks_of

LONG = 1000  # samples
# The names in the package are functions.
module, designs = import_module("sdt_drake.run.simulate"), import_module("sdt_drake.run.design")
folder = None  # for the results; without one, every run is a new one
_simulate, _load_device, _plan_of = module.simulate, designs.load_device, designs.plan_of
_computed = [name for name, x in vars(designs.Design).items() if isinstance(x, cached_property)]
_devices = {}  # that ship with the package, by what is asked for
_plans = {}  # of motions that ship with the package, by fingerprint of what is asked for
_parsed = functools.cache(yaml_files.parse_yaml)


def once(name, make):
    """What `make` gives, of the process that asks for it by this name first."""
    with (folder / f"{name}.pickle").open("a+b") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        if content := file.read():
            return pickle.loads(content)
        made = make()
        pickle.dump(made, file)
        return made


def simulate(design, diagram=None, **options):
    """As the package's, which is run where nobody had the same loop of the same design yet."""
    design = designs.as_design(design)
    loop = make_loop(design) if diagram is None else diagram
    is_long = folder is not None and len(design.motion.v) >= LONG
    if not is_long or options or type(loop) is not Loop or loop.HasSubsystemNamed("drawing"):
        return _simulate(design, loop, **options)
    return once(_fingerprint(design, loop), lambda: _simulate(design, loop))


def load_device(scenario):
    """As the package's, loaded once in a process if robot and motors ship with it: torques of the
    same robot along the same motion are computed once."""
    files = scenario.robot, scenario.device.catalogue
    if not all(file.startswith(PACKAGE_PREFIX) for file in files):
        return _load_device(scenario)
    key = scenario.robot, repr(scenario.device)
    if key not in _devices:
        _devices[key] = _load_device(scenario)
    return _devices[key]


def plan_of(scenario, robot):
    """As the package's, planned once in a process if the motion is one that ships with it."""
    if not scenario.motion.startswith(PACKAGE_PREFIX):
        return _plan_of(scenario, robot)
    how = scenario.motion, scenario.period, scenario.torque_margin, scenario.planner
    robot = as_driven(robot, scenario.drive)
    key = _hashed(repr(how) + robot.sdf, robot)
    if key not in _plans:
        _plans[key] = _plan_of(scenario, robot)
    return _plans[key]


def parse_yaml(text):
    """As the package's, which reads the same text once in a process: it is pure Python."""
    return copy.deepcopy(_parsed(text))


def _fingerprint(design, loop):
    """Of what was asked for by whatever name, the blocks of the loop, and every number in the
    design."""
    blocks = [(type(loop.controller), block.get_name()) for block in blocks_of(loop)]
    scenario = replace(design.scenario, name="")
    numbers = [getattr(design, name) for name in _computed]
    return _hashed(yaml_text(scenario) + repr(blocks), design, *numbers)


def _hashed(said, *numbers):
    parts = (part for value in numbers for part in _numbers(value))
    return hashlib.sha256(b"".join([said.encode(), *parts])).hexdigest()


def _numbers(value):
    if isinstance(value, np.ndarray):
        yield value.tobytes()
    elif is_dataclass(value):
        for field in fields(value):
            yield from _numbers(getattr(value, field.name))
    elif isinstance(value, tuple):
        for part in value:
            yield from _numbers(part)


module.simulate, designs.load_device, designs.plan_of = simulate, load_device, plan_of
yaml_files.parse_yaml = parse_yaml
