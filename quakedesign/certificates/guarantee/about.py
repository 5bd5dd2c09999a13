"""Whether a guarantee is about a task: what it is proved for covers what is asked."""

from dataclasses import fields

from quakedesign.certificates.guarantee.task import Friction, Task
from quakedesign.rationals import six_digits

_SAME = {
    "density": "kg/m^3",
    "shear_modulus": "Pa",
    "length": "m",
    "damping": "kg/s",
    "normal_stress": "Pa",
    "target_slip": "m",
    "operation_time": "s",
}
_SPREADS = ("stiffness", "damping", "authority")


def differences(proved: Task, asked: Task) -> list[str]:
    """What of a task is not covered by the task of a proof, each with both values, SI; empty if everything is.

    Constants of the fault and its reference must be the same; friction, ranges and disturbance lie within those of the
    proof. The name is none of it.
    """
    return [*_other(proved, asked), *_wider(proved, asked), *_rougher(proved.friction, asked.friction)]


def _other(proved: Task, asked: Task) -> list[str]:
    """Constants that are not the same."""
    pairs = {f"{name} [{unit}]": (getattr(proved, name), getattr(asked, name)) for name, unit in _SAME.items()}
    pairs["static friction [-]"] = proved.friction.static, asked.friction.static
    for name, unit, *both in zip(("slip", "rate"), ("1/s^2", "1/s"), proved.growths, asked.growths, strict=True):
        pairs[f"disturbance per {name} [{unit}]"] = both[0], both[1]
    found = [
        f"{name} {six_digits(one)} there, {six_digits(other)} here"
        for name, (one, other) in pairs.items()
        if one != other
    ]
    return found + ([] if proved.shape == asked.shape else ["the shape of the reference"])


def _wider(proved: Task, asked: Task) -> list[str]:
    """Ranges and disturbances beyond those of the proof."""
    pairs = {f"spread of {name} [-]": both for name, *both in zip(_SPREADS, proved.spreads, asked.spreads, strict=True)}
    pairs["disturbance [m/s^2]"] = [proved.amplitude, asked.amplitude]
    if proved.change is not None and asked.change is not None:
        pairs["change of the disturbance [m/s^3]"] = [proved.change, asked.change]
    found = [
        f"{name} up to {six_digits(one)} there, {six_digits(other)} here"
        for name, (one, other) in pairs.items()
        if other > one
    ]
    jumps = proved.change is not None and asked.change is None
    return found + (["a disturbance of the class rate there, one that may jump here"] if jumps else [])


def _rougher(proved: Friction, asked: Friction) -> list[str]:
    """Bounds of friction that reach beyond those of the proof."""
    beyond = {part.name: getattr(asked, part.name) > getattr(proved, part.name) for part in fields(Friction)}
    beyond |= {"static": False, "least": asked.least < proved.least}
    names = [name for name, wider in beyond.items() if wider]
    return [
        f"friction: {name} {six_digits(getattr(proved, name))} there, {six_digits(getattr(asked, name))} here"
        for name in names
    ]
