"""Fields of scenarios, designs and recordings that tests vary."""

from dataclasses import MISSING, fields, replace

from sdt_drake.run.recording import Recording


def kind(label: str, **fields) -> dict:
    """Return the fields of a controller, "p_pi", or "p_pi+id" with its feedforward."""
    name, _, feedforward = label.partition("+")
    fields |= {"kind": name} | ({"feedforward": feedforward} if feedforward else {})
    return {f"controller.{field}": value for field, value in fields.items()}


def weaker(design, share):
    """Return a design whose motors have a share of their torque."""
    device = design.device.nominal
    return replace(design, nominal=replace(device, effort_limit=share * device.effort_limit))


def overruled(thing, **parts):
    """Return a design, or its tuning, with computed parts that contradict the rest."""
    other = replace(thing)
    vars(other).update(parts)
    return other


def recorded(motion, **signals):
    """Return a recording of a motion without errors or torques, but for the given signals."""
    signals = {"q": motion.q, "v": motion.v, "tau": 0 * motion.v} | signals
    signals = {"tau_limited": signals["tau"]} | signals
    given = {"time": motion.time, "q_ref": motion.q, "v_ref": motion.v} | signals
    others = (x.name for x in fields(Recording) if x.default is MISSING and x.name not in given)
    return Recording(**given, **dict.fromkeys(others, 0 * motion.v))
