"""Predictions beside what people reported, and the verdicts."""

import numpy as np
import pytest

from sdt_drake.analysis.reported import Judged, verdict_of_all

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
def rows(reproduction):
    return {row.id: row for row in reproduction.reported.result()}


def test_predictions_are_those_of_other_implementations(rows):
    for id_, (first, second) in BY_OTHERS.items():
        predicted = [rows[id_].predicted[name] for name in SETS]
        np.testing.assert_allclose(predicted, first, rtol=0.02, atol=0.02, err_msg=id_)
        np.testing.assert_allclose(predicted, second, rtol=0.005, atol=0.05, err_msg=id_)
    for name in SETS:  # forward and backward are the same to the model
        forward, backward = (rows[i].predicted[name] for i in ("turn_2_start", "turn_2_backward"))
        assert backward == pytest.approx(forward, abs=0.05)


def test_no_set_passes_both(rows):
    said = verdict_of_all(list(rows.values()))
    assert said.startswith("No parameter set passes both") and "gondola turns: none" in said
    assert "yaw decay: irmak2023, rader2009 and slow_yaw" in said
    both = [judged(1, 1, 1), judged(1, 1, 1, group="gondola turns")]
    assert verdict_of_all(both).startswith("a pass both")


def judged(mean, spread, value, is_range=False, group="yaw decay"):
    return Judged("id", "", "", mean, spread, is_range, "", group, {"a": value})


@pytest.mark.parametrize(
    ("row", "reported", "verdict", "cell"),
    [
        (judged(20, 13.5, 33.4), "20 ± 13.5", "within one standard", "33.4 ✓"),
        (judged(20, 13.5, 33.6), "20 ± 13.5", "too large by 1.0 standard", "33.6 +1.0"),
        (judged(-5, 6.8, -18.6), "-5 ± 6.8", "too small by 2.0 standard", "-18.6 -2.0"),
        (judged(16.5, 3.5, 13, True), "13 to 20", "within the range", "13.0 ✓"),
        (judged(16.5, 3.5, 12.9, True), "13 to 20", "too small", "12.9 -1.0"),
        (judged(np.nan, np.nan, 3), "–", "not judged", "3.0 –"),
    ],
)
def test_verdict_is_made_from_the_numbers(row, reported, verdict, cell):
    assert (row.reported, row.cell("a")) == (reported, cell) and verdict in row.verdict("a")
    assert row.passes("a") == verdict.startswith("within")
