"""The command about polynomial fields: stability, and regions of attraction."""

from pathlib import Path
from time import perf_counter
from typing import Annotated

from cyclopts import Parameter

from quakedesign.cli.options import PLAIN, Force, Output
from quakedesign.cli.shared import app, new_file
from quakedesign.errors import PolynomialError

Text = Annotated[str, Parameter(allow_leading_hyphen=True)]


@app.command
def attraction(
    field: Path,
    /,
    *,
    everywhere: Annotated[bool, Parameter(negative="")] = False,
    relative: float = 1e-4,
    degree: int | None = None,
    shape: Text | None = None,
    out: Path | None = None,
    above: Path | None = None,
    inclusion: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Prove the largest level of a Lyapunov function below which all solutions tend to the origin.

    Exit code 0 if one is proved.

    Parameters
    ----------
    field
        TOML file: in [field] the rate of every state, such as x = "-y" and y = "x + (x^2 - 1)*y", polynomials that
        vanish at the origin; before it V = "..." if V is given. Unless it is, V = x'Px with A'P + PA = -1 for the
        linearised field, or one of degree 2 or 4 that is searched (--everywhere).
    everywhere
        Prove that the solutions from everywhere do, or refute V (without one, all V) by a point.
    relative
        Width of the last step of the bisection, from 1e-6 to below 1.
    degree
        Search other V of at most this even degree, for a larger part of the shape in the region.
    shape
        Polynomial that is positive but at the origin, such as "x^2 + 2*y^2": the largest b is proved for which the part
        where it is at most b lies in the region. With --degree the sum of squares of the states unless given.
    out
        File for the proof (proofs/FORMAT.md); for the refutation where nothing is proved, unless --above is given.
    above
        File for the point that refutes all levels above that of V there.
    inclusion
        File for the proof that the part of the shape lies in the region.
    """
    from quakedesign.sos import Answer, Attraction, Region, region_of_attraction, save_attraction, stability
    from quakedesign.sos.exact.attraction_words import region_facts, region_words
    from quakedesign.sos.exact.field_files import read_field

    began = perf_counter()
    for path, what in ((out, "proof file"), (above, "refutation file"), (inclusion, "proof file")):
        new_file(path, what, force=force)
    rates, function = read_field(field)
    if everywhere and (degree, shape) != (None, None):
        raise PolynomialError("--degree and --shape are of a region. Received --everywhere as well. Leave one out.")
    if everywhere:
        region = Region.of(stability(rates, function))
    else:
        region = region_of_attraction(rates, function, relative=relative, degree=degree, shape=shape)
    files: dict[str, tuple[Path | None, Attraction | Answer | None]] = {
        "file": (out, region.proved or (None if above else region.refuted)),
        "file_above": (above, region.refuted),
        "file_inclusion": (inclusion, region.inclusion),
    }
    written: dict[str, str | None] = dict.fromkeys(files)
    for key, (path, proof) in files.items():
        if path is not None and proof is not None:
            written[key] = str(path)
            proof.save(path) if isinstance(proof, Answer) else save_attraction(proof, path)
    seconds = perf_counter() - began
    lines = [*region_words(region), f"{seconds:.2f} s; checked in exact arithmetic"]
    output.show({**region_facts(region), **written, "seconds": seconds}, lines)
    return 0 if region.proved is not None else 1
