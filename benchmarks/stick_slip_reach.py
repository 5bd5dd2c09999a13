"""How far the guarantee on the stick–slip plant reaches: sampling times, noise and faults, each checked and attacked.

    python benchmarks/stick_slip_reach.py [WORDS OF ROWS]

prints a table: what `guarantee` proves, rounded outward, the worst case found over the claim, CPU time of design and
proof, the verdict of `proofs/check.py`, and what the simulator of `stick_slip_attack` reaches: the largest facet value
(1 is never passed) and slip rate over the claim, of selected courses and of 10 000 periods without selection.
"""

import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from time import process_time

from stick_slip_attack import Attack

import quakedesign as qd
from quakedesign.guarantees.exact.guarantee_files import save_guarantee

CHECK = Path(__file__).parent.parent / "proofs" / "check.py"


def rows():
    """Name, fault and options of `guarantee`."""
    real, lab = qd.load_fault("real-fault"), qd.load_fault("lab-fault")
    for step in (10, 15, 25, 50, 100, 140, 184, 250, 300, 350, 400, 450, 500):
        yield f"real fault, {step} ms", real, {"step": f"{step} ms"}
    yield "real fault, 184 ms, peak", real, {"objective": "peak"}
    yield "real fault, 184 ms, slip noise 1 µm", real, {"slip_noise": "1 um"}
    yield "real fault, 184 ms, slip noise 5 µm", real, {"slip_noise": "5 um"}
    yield "real fault, 184 ms, box ten-percent", real.with_box("ten-percent"), {}
    for excess in (2e-5, 5e-5, 1e-4, 2e-4):
        yield (
            f"real fault, 184 ms, healing {excess:g}",
            replace(real, friction=replace(real.friction, healing=excess)),
            {},
        )
    for step in ("0.5", "1", "2", "3", "4"):
        yield f"lab fault, {step} ms", lab, {"step": f"{step} ms"}
    for first, last in ((92, 184), (150, 184), (50, 184), (184, 368)):
        options = {"step": f"{first} ms", "longest_step": f"{last} ms"}
        yield f"real fault, aperiodic, {first} to {last} ms", real, options
    peak = {"step": "92 ms", "longest_step": "184 ms", "objective": "peak"}
    yield "real fault, aperiodic, 92 to 184 ms, peak", real, peak
    for first, last in ((0.5, 1), (1, 2)):
        yield f"lab fault, aperiodic, {first} to {last} ms", lab, {"step": f"{first} ms", "longest_step": f"{last} ms"}
    yield "2.5 km, 110 ms", replace(real, length=2500.0), {"step": "110 ms"}
    yield "2.5 km, 160 ms", replace(real, length=2500.0), {"step": "160 ms"}
    yield "8 km, 220 ms", replace(real, length=8000.0), {"step": "220 ms"}
    yield "35 MPa, 184 ms", replace(real, effective_normal_stress=35e6), {}
    for name in ("cta", "dia"):
        yield f"real fault, 184 ms, {name}", real, {"controller": name}
    yield "real fault, 184 ms, slip noise 1 µm, cta", real, {"controller": "cta", "slip_noise": "1 um"}
    yield "real fault, 300 ms, cta", real, {"controller": "cta", "step": "300 ms"}
    for step in ("1", "2"):
        yield f"lab fault, {step} ms, cta", lab, {"controller": "cta", "step": f"{step} ms"}
    yield "2.5 km, 110 ms, cta", replace(real, length=2500.0), {"controller": "cta", "step": "110 ms"}
    yield "8 km, 220 ms, cta", replace(real, length=8000.0), {"controller": "cta", "step": "220 ms"}
    yield "35 MPa, 184 ms, cta", replace(real, effective_normal_stress=35e6), {"controller": "cta"}


def row(name, fault, options):
    """Cells of a row."""
    began = process_time()
    answer = qd.guarantee(fault, plant="stick-slip", **options)
    spent = process_time() - began
    if not answer.proved:
        return (name, f"none: {answer.proof.reason}", "", "", "", f"{spent:.1f} s", *[""] * 3)
    claims = answer.proof.claims
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "proof.json"
        save_guarantee(answer.proof, path)
        checked = subprocess.run([sys.executable, CHECK, path], capture_output=True, text=True)
        seen = Attack(json.loads(path.read_text())).run()
    return (
        name,
        f"{claims.peak_slip_rate:.3g} m/s",
        f"{claims.slip_behind:.3g} … {claims.slip_ahead:.3g} m",
        f"{answer.worst.peak_slip_rate / float(claims.peak_slip_rate):.2f}",
        str(len(answer.proof.invariant_set.facets)),
        f"{spent:.1f} s",
        "proved" if checked.returncode == 0 else "REFUSED",
        f"{seen['facet']:.3f} ({seen['long_facet']:.3f})",
        f"{seen['slip_rate']:.3f} ({seen['long_slip_rate']:.3f})",
    )


HEAD = (
    "loop",
    "slip rate",
    "slip behind … ahead",
    "found / proved",
    "facets",
    "CPU",
    "check.py",
    "attack",
    "slip rate of it / claim",
)

if __name__ == "__main__":
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}")
    for one in rows():
        if not sys.argv[1:] or any(word in one[0] for word in sys.argv[1:]):
            print(f"| {' | '.join(row(*one))} |", flush=True)
