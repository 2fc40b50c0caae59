"""Predict the acceptance test of a device: plan, simulate and judge it."""

from collections.abc import Callable
from pathlib import Path

from sdt_drake.io.arguments import instance_of, takes
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.machine.accept.judge import judged
from sdt_drake.machine.accept.plan import PlannedMotion, accept_plan
from sdt_drake.machine.accept.results import Accepted
from sdt_drake.machine.accept.spec import Acceptance
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.run.design import make_design
from sdt_drake.run.recording import Recording
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.run.threads import threads


@takes(scenario=instance_of(Scenario, "sdt_drake.load"))
def accept_predict(scenario: Scenario, spec: Acceptance | str | Path = "acceptance") -> Accepted:
    """Plan an acceptance test, simulate it with the loop of a scenario, and judge it.

    Args:
        scenario: the device and its loop, on the coupled plant; its motion is not used.
        spec: as in `accept_plan`.

    Raises:
        InputError: as `accept_plan` and `accept_judge`.
    """
    return predicted(scenario, spec, lambda line: None)


def predicted(
    scenario: Scenario, spec: Acceptance | str | Path, say: Callable[[str], None]
) -> Accepted:
    """Do what `accept_predict` does, and say before and after each motion how far it is.

    Args:
        scenario: as there.
        spec: as there.
        say: called with each line.

    Raises:
        InputError: as there.
    """
    if scenario.plant.kind != "coupled":
        raise InputError("axis, expected coupled, which moves the head", place="plant.kind")
    plan = accept_plan(scenario, spec)
    say(f"Acceptance test {plan.summary().title}, to simulate")

    def run(one: PlannedMotion) -> Recording:
        return simulate(make_design(scenario, robot=plan.device, motion=one.motion))

    with threads(2) as pool:
        ran = with_progress(pool.map(run, plan.motions), len(plan.motions))
        runs, done = dict[str, Recording](), 0.0
        for one, made in zip(plan.motions, ran, strict=True):
            runs[one.tests.name] = made
            done += one.motion.duration
            say(f"{one.tests.name}: {done:.0f} of {plan.duration:.0f} s simulated")
    recorded = [
        Recorded(
            Path(f"{name}/run.csv"), run.time,
            {"q": run.q, "v": run.v, "q_ref": run.q_ref,
             "tau": plan.device.joint_torque(run.tau)}, of_links=True,
        )
        for name, run in runs.items()
    ]  # fmt: skip
    return judged(plan.device, plan.spec, plan.motions, recorded, plan.left_out)
