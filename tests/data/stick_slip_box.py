"""A small file of the kind stick_slip: five facets that bound a box, and a few more. It is not a proof."""

import copy
import json
from fractions import Fraction as F

import pytest
from standalone_guarantee import CHECK

from quakedesign.errors import CertificateError
from quakedesign.guarantees import read_guarantee
from quakedesign.lyapunov.exact.claim import Verdict

STICK = CHECK.beside("guarantee.stick_slip")
CLAIMS = ("slip_behind", "slip_ahead", "peak_slip_rate", "least_pressure", "largest_pressure")
LEANING = [
    ["1/5", "1/9", "1/30"],
    ["-1/5", "1/9", "1/30"],
    ["1/5", "-1/9", "-1/30"],
    ["-1/5", "-1/9", "1/40"],
    ["1/10", "-1/3", "1/20"],
    ["-1/10", "1/3", "-1/20"],
]
FACETS = [["5/2", "0", "0"], ["0", "1", "0"], ["0", "0", "1/4"], ["-5/2", "0", "0"], ["0", "0", "-1/4"], *LEANING]
MULTIPLIERS = [
    ["0", "0", "0", "0", "0"],
    ["1/7", "1", "-1/5", "1", "0"],
    ["0", "1", "0", "0", "1/2"],
    ["0", "0", "1/3", "1", "1"],
    ["1/10", "0", "0", "0", "1/3"],
    *[["0", str(i % 2), "-1/12", str(i // 2 % 2), "1/4"] for i in range(6)],
]


NOISE = {False: {"rest_slip": "0", "slip_noise": "0"}, True: {"rest_slip": "1/40", "slip_noise": "1/90"}}
NOISE["aperiodic"] = NOISE[True] | {"step": "3/8", "longest": "1/2"}


def bases(cuts, more=()):
    """Vertices of a box of three sides: of e1 the two numbers in `cuts`."""
    return [[a, b, d, *more] for a in cuts for b in (1, len(FACETS)) for d in (2, 4)]


def box(noisy=False):
    """The file; its constraints are 11 facets, y >= 0, the ends of the slice, then at rest slip >= 0 and others."""
    many = len(FACETS)
    cuts = ((3, many + 1), (many + 1, many + 2), (0, many + 1))
    places = (0, 0, 1, 1, 1, 2, 2)
    return copy.deepcopy(
        {
            "format": 1,
            "kind": "stick_slip",
            "fault": {
                "name": "a box",
                "density": "2",
                "shear_modulus": "1",
                "length": "2",
                "damping": "12",
                "normal_stress": "16",
                "spreads": {"stiffness": "1/10", "damping": "1/3", "authority": "1/20"},
                "friction": {"static": "2/5", "least": "1/5", "largest": "2/5",
                             "weakening": "1/8", "strengthening": "1/40", "rate_slope": "1/60"},
            },
            "reference": {"shape": ["0", "0", "3", "-2"], "target_slip": "3/2", "operation_time": "9"},
            "disturbance": {"amplitude": "1/8", "growths": {"slip": "1/60", "rate": "-1/90"}},
            "loop": {"step": "1/2", "rate_gain": "2", "target_gain": "3", "return_rate": "9/5",
                     "level_gain": "5/4", "slip_gain": "3/2", **NOISE[noisy]},
            "set": {
                "facets": FACETS,
                "multipliers": MULTIPLIERS,
                "sliding": [bases(cut) for cut in cuts],
                "resting": [bases(cuts[place], [many + 2 + (place == 1)]) for place in places],
            },
            "claims": dict(zip(CLAIMS, ("1", "1", "1", "-50", "50"), strict=True)),
        }
    )  # fmt: skip


def period_of(document):
    """One period as the standalone checker sees it."""
    growths = [F(document["disturbance"]["growths"][name]) for name in ("slip", "rate")]
    rock, task = STICK.read_rock(document["fault"]), STICK.read_task(document)
    law, reach = STICK.read_law(document["loop"]), STICK.read_reach(document["set"])
    return STICK.Period(rock, task, F(document["reference"]["target_slip"]), growths, law, reach)


def changed(document, *changes):
    """A copy with changed entries: pairs of a path, and a value or a function of the old one."""
    document = copy.deepcopy(document)
    for path, new in changes:
        holder = document
        for key in path[:-1]:
            holder = holder[key]
        holder[path[-1]] = new(holder[path[-1]]) if callable(new) else new
    return document


def times(share):
    """A number of a file, or all of a list, times another one."""
    return lambda old: [times(share)(v) for v in old] if isinstance(old, list) else str(F(old) * F(share))


def refused(document, reason=None):
    """The standalone checker refuses it with a reason."""
    with pytest.raises(CHECK.Refused, match=reason):
        CHECK.check(json.dumps(document))
    return True


def package_refuses(document):
    """Whether the package refuses or does not prove it."""
    try:
        claim = read_guarantee(document)
    except CertificateError:
        return True
    return claim.check() is not Verdict.PROVED
