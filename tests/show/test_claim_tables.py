"""Published and computed values of a claim as a table."""

from sdt_drake.show.reports.paper import value_table


def values(published, computed):
    made = value_table({"published": published, "computed": computed})
    return made.header, made.rows


def test_values_of_claims_stand_in_a_table():
    assert values([4640.0, None], [4.5e-13, True]) == (
        ["", "joint 1", "joint 2"],
        [["published", "4640", "–"], ["computed", "4.5e-13", "yes"]],
    )
    assert values(0.5, [250.28, 52016.4]) == (  # of no joint alone
        ["", "joint 1", "joint 2", "all"],
        [["published", "", "", "0.5"], ["computed", "250.28", "52016", ""]],
    )
    assert values({"a_b": 1}, {"a_b": 2.0}) == (
        ["", "a b"],
        [["published", "1"], ["computed", "2"]],
    )
    parts = {"x_y": [1.0, 2.0], "z": {"joint 2": 3.0}}
    assert values("small", parts)[1] == [
        ["published", "", "", "small"],
        ["computed, x y", "1", "2", ""],
        ["computed, z, joint 2", "", "", "3"],
    ]
    assert values(True, False) == (["", ""], [["published", "yes"], ["computed", "no"]])
