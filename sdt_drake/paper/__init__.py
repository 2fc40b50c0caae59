"""The paper: its numbers, its results computed again, verdicts on its claims, and the report.

`published`: numbers that the paper prints. `step_loop`: the loop of Figure 4. `reproduction`:
Table 1, step responses and tracking runs. `claims`: verdicts from their numbers. `diagrams`,
`files`, `report`: what `sdt-drake reproduce` writes.
"""
