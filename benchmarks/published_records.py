"""Public laboratory records and a simulated one, converted from the repositories of their authors.

Run with ``python benchmarks/published_records.py CLONES FOLDER``, where ``CLONES`` holds what ``git clone`` makes of
``https://github.com/``: ``PennStateRockandSedimentMechanics/xlook``, ``pgiacomel/steadystate`` and ``ydluo/qdyn``.
Each becomes CSV files in ``FOLDER``, which `identify` reads and the slow tests of published fits find by the variable
``QUAKEDESIGN_RECORDS``. A clone that is not there is passed over, with a word. ``--cut`` writes means of neighbouring
samples of the basalt and sepiolite steps, below 50 kB each, as they are in ``tests/data/records``.

Not converted: p4309 (`jrleeman/LeemanNatComm2016`), whose repository of 970 MB was too large to be fetched.
"""

import argparse
import gzip
import io
import pickle
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

COLUMNS = "time [s], load_point_displacement [um], shear_stress [MPa], normal_stress [MPa]"
STEADYSTATE = {
    "sepiolite_1": ("0225b97", "velstep1_TR2_exp013_sepiolite.txt", 0),
    "sepiolite_2": ("0225b97", "velstep2_TR2_exp013_sepiolite.txt", 58),
    "sepiolite_3": ("0225b97", "velstep3_TR2_exp013_sepiolite.txt", 24),
    "basalt_4": ("e40d452", "velstep4_BRAVA_expb819_basalt_Giacomel_et_al_2021.txt", 5),
    "basalt_7": ("e40d452", "velstep7_BRAVA_expb819_basalt_Giacomel_et_al_2021.txt", 4),
}
"""Commit, file, and how many samples a mean of the cut record has; 0 where it is not cut."""
QDYN = "e06edb1db4d402fbc4581e086a019d30e433cc56", "test/stickslip/stickslip_results_frozen_5ba3c6b008.tar.gz"
XLOOK = "0fdd597", "example/p655intact100l"
P655_WINDOWS = {"p655_1": (24303, 25084), "p655_2": (25397, 26460)}
"""First and last row of the printed fits, among the rows that xlook's `order` leaves."""


def main() -> None:
    """Convert what is there."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("clones", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cut", action="store_true", help="only means of the basalt and sepiolite steps")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for name, convert in {"steadystate": steps, "xlook": p655, "qdyn": stick_slip}.items():
        if not (given.clones / name).exists():
            print(f"passed over: {given.clones / name} is not there")
        elif name == "steadystate" or not given.cut:
            for path in convert(given.clones / name, given.folder, given.cut):
                print(f"written: {path}")


def content(clone: Path, commit: str, path: str) -> bytes:
    """A file of a repository at a commit."""
    return subprocess.run(["git", "-C", clone, "show", f"{commit}:{path}"], check=True, capture_output=True).stdout


def steps(clone: Path, folder: Path, cut: bool) -> list[Path]:
    """Single velocity steps on sepiolite and basalt, with columns as their authors name them."""
    written = []
    for name, (commit, path, every) in STEADYSTATE.items():
        if cut and not every:
            continue
        table = np.loadtxt(io.BytesIO(content(clone, commit, path)), skiprows=1)
        if cut:
            table = table[: len(table) // every * every].reshape(-1, every, table.shape[1]).mean(axis=1)
        heading = "time [s], load_point_displacement [um], friction, normal_stress [MPa]"
        written.append(folder / f"{name}.csv")
        formats = "%.3f,%.3f,%.6f,%.3f" if cut else "%.6f,%.6f,%.6f,%.6f"
        np.savetxt(written[-1], table, fmt=formats, header=heading, comments="")
    return written


def reduced_p655(data: bytes) -> "np.ndarray":
    """Time [s], load point [um], shear and normal stress [MPa], as the file p655_r reduces the raw readings.

    Big-endian, five channels after a header of 2724 bytes. Rows are those of the raw file.
    """
    count = int.from_bytes(data[20:24], "big")
    period, load, shear, _, normal = np.frombuffer(data[2724:], dtype=">f4").astype(float).reshape(5, count)
    time, load, shear, normal = (
        np.cumsum(period) / 1e4,
        load * 0.076472,
        shear * 1.597778959e-3,
        normal * 3.31712805707e-3,
    )
    shear = _without_offset(shear, 4075, 4089)
    normal, load, shear = normal - normal[42], load - load[1459], shear - shear[1459]
    normal[:43] = load[:1460] = shear[:1460] = 0.0
    load = _without_offset(_without_offset(load, 18593, 19058), 66262, 67830)
    return np.delete(np.column_stack([time, load, shear, normal + 1e-7]), 86283, axis=0)


def _without_offset(values: "np.ndarray", first: int, last: int) -> "np.ndarray":
    """xlook's `offset_int … y`: constant between two rows, and what follows shifted to go on from there."""
    found = values.copy()
    found[first:last] = values[first]
    found[last:] -= values[last] - values[first]
    return found


def ordered(displacement: "np.ndarray") -> "np.ndarray":
    """Rows that xlook's `order` keeps: those at which a displacement is larger than at all rows before."""
    highest = np.maximum.accumulate(displacement)
    kept: np.ndarray = np.flatnonzero(np.concatenate([[True], displacement[1:] > highest[:-1]]))
    return kept


def p655(clone: Path, folder: Path, cut: bool) -> list[Path]:
    """Every sample of the windows of the two printed fits."""
    table = reduced_p655(content(clone, *XLOOK))
    rows = ordered(table[:, 1])
    written = []
    for name, (first, last) in P655_WINDOWS.items():
        written.append(folder / f"{name}.csv")
        part = table[rows[first] : rows[last] + 1]
        np.savetxt(written[-1], part, fmt="%.6f", delimiter=",", header=COLUMNS, comments="")
    np.savez_compressed(folder / "p655.npz", table=table)
    return [*written, folder / "p655.npz"]


class _ArraysOnly(pickle.Unpickler):
    """Nothing but arrays of numbers: a pickle may run code otherwise."""

    def find_class(self, module: str, name: str) -> Any:
        if (module.replace("_core", "core"), name) not in {
            ("numpy.core.multiarray", "_reconstruct"),
            ("numpy", "ndarray"),
            ("numpy", "dtype"),
        }:
            raise pickle.UnpicklingError(f"a record must hold arrays alone. Received {module}.{name}.")
        return super().find_class(module.replace("numpy.core", "numpy._core"), name)


def stick_slip(clone: Path, folder: Path, cut: bool) -> list[Path]:
    """QDYN's frozen spring-block run with rate-and-state friction: time [s], state [s], friction."""
    data = gzip.decompress(content(clone, *QDYN))
    run = _ArraysOnly(io.BytesIO(data)).load()["RSF"]
    path = folder / "qdyn_stick_slip.npz"
    np.savez_compressed(path, time=run["t"], theta=run["var1"], friction=run["var2"])
    return [path]


if __name__ == "__main__":
    main()
