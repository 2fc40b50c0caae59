"""The page of emergency stops: its sentences, and the caution on every page."""

import dataclasses

import numpy as np
import pytest

import sdt_drake as sdt
from sdt_drake.analysis.stopping import StopLimits, Stopping
from sdt_drake.analysis.stops import Stops
from sdt_drake.motion import Motion
from sdt_drake.show.figures.stops import stops_figure
from sdt_drake.show.reports.stops import stop_findings, write_stops

MOTORS = ["AC-203", "TM-3950", "TM-2150", "TM-2150"]


@pytest.fixture(scope="module")
def few() -> Stops:
    """Five stops of an arm that ends at 0.1 rad/s."""
    v = np.outer(np.linspace(0, 0.1, 5), [1, 0, 0, 0])
    design = sdt.design(sdt.load("coupled_pi"), motion=Motion.from_speeds(0.005, np.zeros(4), v))
    return sdt.stops(design, Stopping(category=1, deceleration=[0.2, 1, 1, 1], motors=MOTORS))


def test_every_page_of_stops_says_that_it_is_no_statement_on_safety(few, tmp_path, undrawn):
    page = write_stops(few, "an arm", 0.005, tmp_path / "out")
    for name in ("report.html", "report.md", "3d.html"):
        text = (page.parent / name).read_text(encoding="utf-8").lower()
        assert "no statement on safety" in text, name
    assert "no statement on safety" in stops_figure(few).get_suptitle()
    rows = (page.parent / "stops.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + len(few.time) == 6 and "g_onset" in rows[0]


def other(stops, **figures) -> list[str]:
    """What is said if some stops had other figures: by name, value, joint and row."""
    changed = {name: values.copy() for name, values in stops.figures.items()}
    for name, (value, *place) in figures.items():
        changed[name][tuple(place)] = value
    return stop_findings(dataclasses.replace(stops, figures=changed))


@pytest.mark.parametrize(
    ("figure", "sentence"),
    [
        ({"stopping_time": (9.5, 2, 1)}, "takes 9.500 s (joint 2 'roll', stop at 0.010 s)."),
        ({"stopping_time": (np.inf, 3, 1)}, "1 stops have not ended after 60 s, first that"),
        ({"stopping_time": (np.inf, 3, 1)}, "the longest does not end (joint 2 'roll', stop"),
        ({"g": (4.0, 1)}, "The pilot feels up to 4.000 G (stop at 0.005 s), with an onset of"),
        ({"joint_stop_speed": (0.5, 1, 2)}, "reaches a stop of the joint with 28.65 deg"),
        ({"brake_load": (1.25, 2, 1)}, "do not hold gravity where joints come to rest; it"),
        ({"brake_load": (0.25, 2, 1)}, "Brakes alone hold gravity where joints come to rest"),
        ({"longer": (2.0, 3)}, "1 of 5 ramps are longer than asked for, as motors lack"),
        ({"drive_torque": (1.5, 3, 1)}, "joint 2 'roll' needs 150.0 % at 0.015 s: no ramp is"),
    ],
)  # fmt: skip
def test_findings_on_stops_say_what_the_figures_are(few, figure, sentence):
    assert any(sentence in one for one in other(few, **figure))


@pytest.mark.parametrize(
    ("limits", "sentence"),
    [
        ({}, "No limits were given."),
        ({"g": 5}, "All limits that were given are kept."),
        ({"g": 0.5}, "Beyond their limits: G at the head, 1.0"),
        ({"stopping_time": [1e-3, 9, 9, 9]}, "limits: stopping time, joint 1 'planet"),
    ],
)  # fmt: skip
def test_findings_on_stops_compare_them_with_limits(few, limits, sentence):
    none = dataclasses.replace(few.setting.brakes, energy=np.full(4, np.inf))
    stopping = dataclasses.replace(few.setting.stopping, limits=StopLimits(**limits))
    setting = dataclasses.replace(few.setting, stopping=stopping, brakes=none)
    said = stop_findings(dataclasses.replace(few, setting=setting))
    assert any(sentence in one for one in said), said
