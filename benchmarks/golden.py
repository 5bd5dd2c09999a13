"""Golden set: what every command answers on many faults, recorded once and compared after a change of structure.

``python benchmarks/golden.py record FILE`` runs the commands (about ten minutes on two cores) and writes exit codes and
JSON; ``compare FILE`` runs them again and lists every difference, the largest relative one of numbers first. The
faults are the presets and ten others; certificates go through both checkers. Nothing is read from the cache.
"""

import argparse
import json
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PRESETS = ROOT / "quakedesign" / "fault" / "presets"
OTHERS = {  # preset and what is replaced in it
    "long": ("real-fault", {"5 km": "8 km"}),
    "short": ("real-fault", {"5 km": "1.5 km"}),
    "deep": ("real-fault", {"50 MPa": "90 MPa"}),
    "soft": ("real-fault", {"30 GPa": "12 GPa"}),
    "brittle": ("real-fault", {"276.35 mm": "180 mm"}),
    "boxed": ("real-fault", {'uncertainty = "paper"': 'uncertainty = "ten-percent"'}),
    "linear": ("real-fault", {"exponential-slip-weakening": "linear-slip-weakening"}),
    "quick": ("lab-fault", {'sampling_time = "1 ms"': 'sampling_time = "0.5 ms"'}),
    "rough": ("geothermal-fault", {"100 um": "300 um"}),
    "small": ("crustal-patch", {"evolution_effect = 0.015": "evolution_effect = 0.0153"}),
}
COMMANDS = {
    "fault": "fault {fault} --json",
    "derive": "derive {fault} --json",
    "limits": "limits {fault} --json",
    "guarantee": "guarantee {fault} --json",
    "guarantee-peak": "guarantee {fault} --objective peak --json",
    "guarantee-lag": "guarantee {fault} --lag 100s --json",
    "guarantee-late": "guarantee {fault} --delay 1ms --json",
    "simulate": "simulate {fault} --json",
    "compare": "compare {fault} --json",
    "export": "export {fault} --json --out {folder}/c",
}
ALONE = {
    "errata": "errata --json",
    "certify-cta": "certify cta --gains 7 5 2.3 1.1 --lipschitz 1 --json",
    "certify-dia": "certify dia --gains 2 5 1 0.1 --lipschitz 0.5 --json",
    "certify-elqr": "certify elqr lab-fault --gains 10000000000/24 25000000/36 1000000000/24 10000000/72 --json",
    "sos": "sos x^4-2*x^2+1 --json",
    "sos-not": "sos x^4*y^2+x^2*y^4+1-3*x^2*y^2 --json",
    "attraction": "attraction {folder}/field.toml --json",
    "scale": "scale lab-fault real-fault --json",
    "identify": "identify {folder}/record.csv --fault crustal-patch --json",
}


def fault_files(folder: Path) -> dict[str, str]:
    """Presets by name, and files of the other faults."""
    faults = {path.stem: path.stem for path in sorted(PRESETS.glob("*.toml"))}
    for name, (preset, changes) in OTHERS.items():
        text = (PRESETS / f"{preset}.toml").read_text(encoding="utf-8").replace(f'"{preset}"', f'"{name}"')
        for before, after in changes.items():
            if before not in text:
                raise ValueError(f"{preset} has no {before!r}")
            text = text.replace(before, after, 1)
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
        faults[name] = str(folder / f"{name}.toml")
    return faults


def record() -> Iterator[str]:
    """Rows of a record: a smooth answer to a step of the load point from 1 to 10 um/s."""
    for i in range(-200, 1200):
        t = i / 10
        slip = 1e-6 * t * (10 if t > 0 else 1)
        friction = (
            0.6
            if t <= 0
            else 0.6 + 0.02 * math.exp(-slip / 2e-5) * (1 - math.exp(-t)) - 0.01 * (1 - math.exp(-slip / 2e-5))
        )
        yield f"{t:.1f},{slip:.9e},{friction:.9f}"


def calls(folder: Path) -> Iterator[tuple[str, list[str]]]:
    """Name and arguments of every call of Python."""
    command = ["-m", "quakedesign"]
    (folder / "field.toml").write_text('[field]\nx = "-y"\ny = "x + (x^2 - 1)*y"\n', encoding="utf-8")
    (folder / "record.csv").write_text("\n".join(["time [s],load_point [m],friction", *record()]), encoding="utf-8")
    for name, line in ALONE.items():
        yield name, command + line.format(folder=folder).split()
    for fault, where in fault_files(folder).items():
        for name, line in COMMANDS.items():
            (folder / f"{name}-{fault}").mkdir()
            arguments = line.format(fault="\0", folder=folder / f"{name}-{fault}").split()
            yield f"{name} {fault}", command + [a.replace("\0", where) for a in arguments]
    for path in sorted((ROOT / "proofs" / "certificates").rglob("*.json")):
        own = str(path.relative_to(ROOT))
        yield f"check {own}", [*command, "check", own]
        yield f"proofs/check.py {own}", ["proofs/check.py", own]


def answer(arguments: list[str], folder: Path) -> dict[str, Any]:
    """Exit code, JSON or text, and errors of one call."""
    environment = os.environ | {"QUAKEDESIGN_CACHE": "off", "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
    )
    out, err = (text.replace(str(folder), "FOLDER") for text in (done.stdout, done.stderr))
    try:
        said: Any = json.loads(out)
    except ValueError:
        said = out
    refused = [line for line in err.splitlines() if line.startswith("quakedesign:")]
    return {"exit": done.returncode, "out": said, "err": refused}


def answers(only: str) -> dict[str, Any]:
    """Every answer by the name of its call, two at a time; only those whose names match a pattern."""
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
        folder = Path(name)
        named = {name: call for name, call in calls(folder) if re.search(only, name)}
        found: dict[str, Any] = {}
        for key, one in zip(named, pool.map(lambda call: answer(call, folder), named.values()), strict=True):
            found[key] = one
            print(f"\r{len(found)}/{len(named)}", end="", file=sys.stderr, flush=True)
    return found


def differences(before: Any, after: Any, where: str) -> Iterator[tuple[float, str]]:
    """Places in which two answers differ, each with the relative difference of numbers, infinite for all else."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in [*before, *(after.keys() - before.keys())]:
            yield from differences(before.get(key, "absent"), after.get(key, "absent"), f"{where}.{key}")
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for i, (old, new) in enumerate(zip(before, after, strict=True)):
            yield from differences(old, new, f"{where}[{i}]")
    elif before != after and not where.endswith(".seconds"):
        numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in (before, after))
        size = abs(before - after) / max(abs(before), abs(after)) if numbers else math.inf
        yield size, f"{where}: {str(before)[:160]!r} -> {str(after)[:160]!r}"


def main() -> int:
    """Record or compare."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("what", choices=["record", "compare"])
    parser.add_argument("file", type=Path)
    parser.add_argument("--only", default="", help="pattern of the names of calls")
    given = parser.parse_args()
    found = answers(given.only)
    if given.what == "record":
        given.file.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        return 0
    before = json.loads(given.file.read_text(encoding="utf-8"))
    rows = sorted(differences({k: v for k, v in before.items() if k in found}, found, ""), reverse=True)
    print("\n".join(f"{size:8.1e}  {what}" for size, what in rows) or "no difference")
    return 1 if rows else 0


if __name__ == "__main__":
    sys.exit(main())
