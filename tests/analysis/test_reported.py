"""What the observer predicts beside what people reported, and the verdicts."""

import numpy as np
import pytest

from sdt_drake.analysis.reported import Judged, validate, verdict_of_all

SETS = ("clark2019", "slow_yaw", "rader2009", "irmak2023")

# By two other implementations: one of the equations alone, with an own integrator, and one of
# scipy, restarted at each jump of the motions. Yaw down to 37 % after start and stop
# [s]; felt roll at the plateau of 1.56 G and 2 G [deg]; felt pitch rate of Coriolis [deg/s].
BY_OTHERS = {
    "yaw_start": ((27.1, 13.7, 15.9, 13.7), (27.18, 13.95, 16.10, 13.95)),
    "yaw_stop": ((32.1, 14.8, 17.4, 14.8), (32.18, 15.04, 17.61, 15.04)),
    "forward": ((16.7, 16.7, 16.7, 16.7), (16.7, 16.7, 16.7, 16.7)),
    "turn_1.56_start": ((33.9, 18.9, 33.1, 6.7), (33.64, 18.72, 32.93, 6.75)),
    "turn_1.56_end": ((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)),
    "turn_2_start": ((57.6, 29.0, 55.5, 7.8), (57.50, 28.82, 55.33, 7.78)),
    "coriolis": ((39.0, 29.5, 37.0, 42.0), (39.34, 29.51, 37.34, 42.07)),
}


@pytest.fixture(scope="module")
def rows():
    return {row.id: row for row in validate()}


@pytest.mark.parametrize("id_", BY_OTHERS)
def test_predictions_are_those_of_other_implementations(rows, id_):
    first, second = BY_OTHERS[id_]
    predicted = [rows[id_].predicted[name] for name in SETS]
    np.testing.assert_allclose(predicted, first, rtol=0.02, atol=0.02)
    np.testing.assert_allclose(predicted, second, rtol=0.005, atol=0.05)


def test_forward_and_backward_are_the_same_to_the_model(rows):
    for name in SETS:
        forward, backward = (rows[i].predicted[name] for i in ("turn_2_start", "turn_2_backward"))
        assert backward == pytest.approx(forward, abs=0.05)
        assert rows["turn_2_start_pilots"].predicted[name] == forward


def test_no_set_passes_both(rows):
    said = verdict_of_all(list(rows.values()))
    assert said.startswith("No parameter set passes both") and "gondola turns: none" in said
    assert "yaw decay: irmak2023, rader2009 and slow_yaw" in said
    by_hand = {
        (row.id, name): abs(row.predicted[name] - row.mean) <= row.spread
        for row in rows.values()
        for name in SETS
    }
    assert by_hand == {(row.id, name): row.passes(name) for row in rows.values() for name in SETS}


def judged(mean, spread, value, is_range=False, group="yaw decay"):
    return Judged("id", "", "", mean, spread, is_range, "", group, {"a": value})


@pytest.mark.parametrize(
    ("row", "reported", "verdict"),
    [
        (judged(20, 13.5, 33.4), "20 ± 13.5", "within one standard deviation"),
        (judged(20, 13.5, 33.6), "20 ± 13.5", "too large by 1.0 standard deviations"),
        (judged(-5, 6.8, -18.6), "-5 ± 6.8", "too small by 2.0 standard deviations"),
        (judged(16.5, 3.5, 13, True), "13 to 20", "within the range"),
        (judged(16.5, 3.5, 12.9, True), "13 to 20", "too small"),
        (judged(16.7, np.nan, 16.7), "16.7", "not judged, no spread is known"),
        (judged(np.nan, np.nan, 3), "–", "not judged, no spread is known"),
    ],
)
def test_verdict_is_made_from_the_numbers(row, reported, verdict):
    assert (row.reported, row.verdict("a")) == (reported, verdict)
    assert row.passes("a") == verdict.startswith("within")


def test_who_passes_both_is_named():
    rows = [judged(1, 1, 1), judged(1, 1, 1, group="gondola turns")]
    assert verdict_of_all(rows).startswith("a pass both")
