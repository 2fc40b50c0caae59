"""What flights teach, and what of it is left on another device.

    python tests/benchmarks/bench_learning_kept.py [OUT] [--studies ...]

Learns the reference motion from three flights of wrong_model, in OUT (by default "learned"), and
flies planned and learned reference with another pilot, with colder and warmer joints, and with
elastic ones: a study for each. Prints joint 2's errors as a table. Some 34 runs of 30 s of motion.
"""

import argparse
from pathlib import Path

import numpy as np
from timing import head, row

from sdt_drake.cli.app import main as sdt_drake
from sdt_drake.studies.results import read_study_table

FRICTION = [f"plant.friction.{name}" for name in ("coulomb", "breakaway", "viscous")]
STUDIES = {
    "payload": ("kg", ["plant.deviation.payload_mass"], "offset", [-30, 0, 30]),
    "friction": ("times", FRICTION, "factor", [0.5, 2]),
    "elasticity": ("rad/s", ["plant.elasticity.natural_frequency[2]"], "value", [132, 264]),
}
"""By name: unit of the level, fields, how they change, levels. The structure's own frequency is
66 rad/s; joint 2 alone is elastic, with its encoder on the motor: springs and friction in all
joints take minutes for each run."""

STUDY = """\
name: {name}
scenario: {base}
variables:
  - name: reference
    fields: [learned]
    distribution: !Choice {{values: [planned.csv, learned.csv]}}
  - {{name: {name}, fields: {fields}, apply: {apply}, distribution: !List {{values: {levels}}}}}
"""


def main(out, studies):
    for label in ("p_pi", "p_pi+id"):
        kind, _, feedforward = label.partition("+")
        folder = out / label
        changes = ["--set", f"controller.kind={kind}"]
        changes += ["--set", f"controller.feedforward={feedforward}"] if feedforward else []
        run("learn", "wrong_model", *changes, "--flights", "3", "--all", "--out", str(folder))
        run("plan", "reference", "--out", str(folder / "planned.csv"))
        scenario = (folder / "scenario.yaml").read_text(encoding="utf-8")
        elastic = scenario.replace("natural_frequency: []", "natural_frequency: [0, 132, 0, 0]")
        (folder / "elastic.yaml").write_text(elastic, encoding="utf-8")
        head(f"{label}, joint 2", "planned, largest [deg]", "learned, largest [deg]", "left [%]")
        for name in studies:
            unit, fields, apply, levels = STUDIES[name]
            base = "elastic.yaml" if name == "elasticity" else "scenario.yaml"
            text = STUDY.format(name=name, base=base, fields=fields, apply=apply, levels=levels)
            (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
            run("study", str(folder / f"{name}.yaml"), "--out", str(folder / name))
            table = read_study_table(folder / name)
            error = np.degrees(table.outcomes["max_abs_position_error_2"])
            for level in levels:
                of = {
                    str(table.inputs["reference"][i]): error[i]
                    for i in np.flatnonzero(table.inputs[name] == level)
                }
                planned, learned = of["planned.csv"], of["learned.csv"]
                left = f"{100 * learned / planned:.0f}"
                row([f"{name} {level:g} {unit}", f"{planned:.4f}", f"{learned:.4f}", left])


def run(*arguments):
    if sdt_drake(list(arguments)):
        raise SystemExit(1)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("out", nargs="?", type=Path, default=Path("learned"))
    parser.add_argument("--studies", nargs="+", choices=STUDIES, default=list(STUDIES))
    main(**vars(parser.parse_args()))
