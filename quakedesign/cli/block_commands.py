"""Command `blocks`, and the parts of other commands for fault files with several blocks."""

import os
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from quakedesign.cli.app import app, new_file, progress
from quakedesign.cli.options import PLAIN, Box, ExactSeconds, FaultName, Force, Output, Shaking, Whole, changed_options
from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.exact import LowerBound, UpperBound, rational
from quakedesign.files import Json, lock_folder, made_folder, require_writable
from quakedesign.loop.loop_setup import LoopSetup
from quakedesign.text import counted

if TYPE_CHECKING:
    from quakedesign.cli.options import LawOptions
    from quakedesign.fault import BlockChain
    from quakedesign.studies.several_blocks import ChainRun, SlidingChainRun


@app.command
def blocks(
    fault: FaultName,
    /,
    *,
    most: Whole = 10,
    least: Whole = 2,
    wells: Literal["one", "each"] = "one",
    coupling: str | None = None,
    step: ExactSeconds | None = None,
    box: Box = None,
    disturbance: Shaking = None,
    out: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Check whether one block is an adequate model of a fault, by guarantees for the fault cut into several blocks.

    Each block has its own friction law, arbitrary within the uncertainty box, and its own disturbance. Springs connect
    neighbouring blocks. A law is designed for each number of blocks. Exit code 0 only if each number has a proof.

    Parameters
    ----------
    most
        Largest number of blocks.
    least
        Smallest number of blocks.
    wells
        one: one well for all blocks (its law measures mean slip and mean slip rate); each: a well for each block.
    coupling
        Stiffness of the springs between blocks divided by the mass of a block, in 1/s^2; by default that of elastic
        strips, G·blocks²/(ρL²), with shear modulus G, density ρ and length L of the fault.
    step
        Sampling time T_s, such as '184 ms'; the fault's by default.
    out
        Folder for the certificate files, one for each number of blocks that has a proof.
    """
    from quakedesign.fault import load_fault
    from quakedesign.guarantees.exact.guarantee_files import save_guarantee
    from quakedesign.studies import one_block

    loaded = load_fault(fault, box=box, disturbance=disturbance)
    loaded.friction.require(blocks=fault)
    files = {count: out / f"{loaded.name}-{count}-blocks.json" for count in range(least, most + 1)} if out else {}
    if out is not None:
        require_writable(out)
        lock_folder(out)
    for path in files.values() if out is not None and out.exists() else ():
        new_file(path, "certificate file", force=force)
    result = one_block(loaded, range(least, most + 1), wells=wells, coupling=coupling, step=step)
    for count, proof in result.proofs.items():
        if files and proof.available:
            with made_folder(files[count].parent):
                save_guarantee(proof, files[count])
    output.show(result.to_dict(), result.lines())
    return 0 if result.proved else 1


def several_blocks(
    fault: str, command: Any, options: dict[str, Any], accepted: Collection[str] = (), box: str | None = None
) -> "BlockChain | None":
    """The blocks of a fault file; None for a file without blocks, and for names that are no file.

    Raises
    ------
    ParameterError
        For options that do not apply to a fault of several blocks.
    """
    from quakedesign.fault import load_chain, with_accepted_fit

    if not str(fault).endswith(".toml") or not os.path.isfile(fault):
        return None
    chain = load_chain(fault, box=box)
    if chain is None:
        return None
    usual = {"fault", "output", "json", "force", "box", "allow_code", "accept_poor_fit", *accepted}
    chosen_values = {name: value for name, value in options.items() if value != ()}
    chosen = changed_options(command, chosen_values)
    others = [name for name in chosen if name not in usual]
    if "more" in others:
        raise ParameterError(
            f"{command.__name__} takes one fault of several blocks at a time. Received more faults. Omit the others."
        )
    if others:
        named = ", ".join(f"--{name.replace('_', '-')}" for name in sorted(others))
        has = {*accepted, "json"} - {"state"} | ({"force", "box"} & options.keys())
        raise ParameterError(
            f"options of {command.__name__} for a fault of several blocks must be among "
            f"{', '.join(f'--{name}' for name in sorted(has)).replace('_', '-')}. Received {named}. Omit these options."
        )
    if chosen.get("accept_poor_fit"):
        chain = replace(chain, fault=with_accepted_fit(chain.fault, True))
    return chain


def chain_at_step(chain: "BlockChain", setup: LoopSetup) -> "BlockChain":
    """The blocks, with the T_s of a loop setup if it has one."""
    return replace(chain, fault=setup.at_step(chain.fault)[0])


def _scope(proof: Any, chain: "BlockChain") -> list[str]:
    """Definitions of the terms in a statement about blocks, and its conditions."""
    from quakedesign.studies.several_blocks import farthest_balance

    meant = "'load of a pressure' in the statement: the well pressure that keeps the blocks in balance on the reference"
    if chain.has_state:
        return [
            "log state: ln(θV/D_c), θ the friction state, V the reference slip rate; pull: shear stress by springs and "
            "wells [MPa]; y in |y|: a log state or a pull; load of a pressure: the planned pressure"
        ]
    if (far := farthest_balance(chain, proof)) is not None:
        meant = (
            "the load of a pressure is the pressure that keeps the averages of the slips, one for each well, on the "
            "reference; slip errors are relative to the equilibrium of each block under these pressures, which is "
            f"within {far:.3g} m of the reference at every time"
        )
    excess = UpperBound(max(rational(block.friction.rest_excess) for block in chain.blocks))
    healed = f"not covered: friction at rest up to {excess:.3g} above friction in slip (healing of the fault file)"
    return [*([healed] if excess else []), meant]


def _values(proof: Any, chain: "BlockChain", one: "ChainRun | SlidingChainRun | None" = None) -> Json:
    if not proof.available:
        return {"verdict": "undecided", "reason": proof.reason}
    proved = {} if one is None else one.proved_values()
    values = {"verdict": "proved", "sentence": proof.sentence(), **proof.to_dict()}
    return {**values, "notes": [*proof.notes, *_scope(proof, chain)], **proved}


def _lines(proof: Any, chain: "BlockChain", one: "ChainRun | SlidingChainRun | None" = None) -> list[str]:
    """Guarantee and its conditions, with a run if there is one; else the reason why nothing is proved."""
    if proof.available:
        conditions = [*proof.statement(), *_scope(proof, chain)]
        return conditions if one is None else one.screen(conditions)
    far = "the command limits gives the pressures that every controller needs for the diffusivity of this fault file"
    return [proof.sentence(), *([far] if chain.diffusivity else [])]


def show_chain(chain: "BlockChain", output: Output) -> int:
    """The command `fault`."""
    from quakedesign.studies.several_blocks import chain_dict, chain_lines

    output.show(chain_dict(chain), chain_lines(chain))
    return 0


def chain_limits(chain: "BlockChain", output: Output, **options: Any) -> int:
    """The command `limits`."""
    from quakedesign.studies import chain_limits as limits

    result = limits(chain, **options)
    output.show(result.to_dict(), result.lines())
    return 0


def block_law(named: str, usual: str, certificate: Path | None = None) -> str:
    """Kind of law of several blocks: `named`, or the default kind if `named` is `usual`, the default of the command.

    Raises
    ------
    ParameterError
        For a kind together with a certificate, which contains its own law.
    UnknownNameError
        For a kind that does not exist.
    """
    from quakedesign.synthesis.guarantee import BLOCK_LAWS

    if named == usual:
        return BLOCK_LAWS[0]
    if certificate is not None:
        raise ParameterError(f"--certificate contains the law. Received --controller {named} too. Omit --controller.")
    require_known(named, BLOCK_LAWS, "controller of several blocks", UnknownNameError)
    return named


def guarantee_chain(
    chain: "BlockChain",
    controller: str,
    step: Any,
    sliding: dict[str, Any] | None,
    out: Path | None,
    force: bool,
    output: Output,
) -> int:
    """The command `guarantee`; `sliding` contains lag [s] and stress [Pa] of blocks in slow sliding."""
    from quakedesign.synthesis import guarantee

    law = block_law(controller, "elqr")
    if out is not None:
        new_file(out, "certificate file", force=force)
    if sliding is None:
        result = guarantee(chain, law, step=step)
    else:
        with progress() as bar:
            bar("design and proof", 0.0)
            result = guarantee(chain, law, step=step, **sliding)
    proof = result.proof
    if out is not None and proof.available:
        with made_folder(out.parent):
            result.save(out)
    unwritten = [f"{out} is not written, as nothing is proved"] if out is not None and not proof.available else []
    written = None if out is None or not proof.available else str(out)
    from quakedesign.studies.several_blocks import ChainRun

    one = None if sliding is not None else ChainRun(chain=chain, controller=law, proof=proof, run=None)
    output.show({**_values(proof, chain, one), "certificate": written}, [*_lines(proof, chain, one), *unwritten])
    return 0 if proof.available else 1


_HEADS = ("law", "proved", "", "in the run", "", "pressure", "")


def compare_chain(chain: "BlockChain", controller: str, sliding: dict[str, Any], output: Output) -> int:
    """The command `compare`: centralised laws, and decentralised laws, in which a well uses its own measurements."""
    from quakedesign.studies.several_blocks import run_of_chain, run_sliding_chain
    from quakedesign.synthesis.guarantee import BLOCK_LAWS

    require_loads(chain, sliding)
    laws = BLOCK_LAWS if controller == "all" else (block_law(controller, "all"),)
    runs: list[ChainRun | SlidingChainRun] = []
    with progress() as bar:
        for place, law in enumerate(laws):
            bar(f"{law}: design, proof and run", place / len(laws))
            runs.append(run_sliding_chain(chain, law, sliding=sliding) if chain.has_state else run_of_chain(chain, law))
    rows = [list(_HEADS), ["", "slip rate", "slip", "slip rate", "slip", "from", "to"], *(one.row() for one in runs)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    about = "its equilibrium" if len(chain.wells) < len(chain.blocks) else "the reference"
    meant = [
        f"(box {chain.fault.box.name}; slip of a block: proved relative to {about},",
        "in the run relative to the reference)",
    ]
    last = "proved on the plant without stick; run on the stick-slip plant, where errors may exceed the bounds"
    if chain.has_state:
        meant = ["(largest slip rate, slip minus reference, pressure minus planned pressure)"]
        stress = LowerBound(sliding["stress"]).quantity("Pa")
        last = f"proved for any shear stress of up to {stress}; run without inertia, under a sinusoidal stress"
    lines = [
        f"{chain.name}: largest errors of {len(chain.blocks)} blocks under {counted(len(chain.wells), 'well')}",
        *meant,
        "",
        *("  ".join(f"{v:{w}}" for v, w in zip(row, widths, strict=True)).rstrip() for row in rows),
        *(f"{one.controller}: {one.proof.sentence()}" for one in runs if one.run is None and one.proof is not None),
        "",
        last,
    ]
    output.show({one.controller: _run_values(one) for one in runs}, lines)
    return 0 if all(one.safe for one in runs) else 1


def require_loads(chain: "BlockChain", sliding: dict[str, Any]) -> None:
    """Raise ParameterError for a lag or a stress if the friction has no state."""
    if not chain.has_state and any(sliding.values()):
        raise ParameterError(
            "--lag and --stress of several blocks need friction with a state. Received "
            f"{chain.fault.friction.name}. Omit these options."
        )


def _run_values(one: "ChainRun | SlidingChainRun") -> Json:
    if one.proof is None:
        return {"run": one.to_dict(), "guarantee": None}
    values = _values(one.proof, one.chain, one)
    return values if one.run is None else {"guarantee": values, "run": one.to_dict()}


def export_chain(
    chain: "BlockChain", law: "LawOptions", fmu: bool, out: Path | None, force: bool, output: Output
) -> int:
    """The command `export`: the designed law, or that of a certificate, if it has a guarantee."""
    from quakedesign.report.terminal import export_lines
    from quakedesign.simulation.export import FILES, block_step, require_free, write_step
    from quakedesign.studies.several_blocks import chain_law

    if chain.has_state and law.certificate is None:
        raise ParameterError(
            "export of blocks in slow sliding takes the law of a certificate. Received none. Use guarantee with --lag, "
            "--stress and --out, then export with --certificate."
        )
    controller = block_law(law.controller, "cta", law.certificate)
    folder = out or Path(f"quakedesign-{chain.name}-{controller}")
    require_free(folder, force)
    with progress() as bar:
        bar("design and proof", 0.0)
        proof = chain_law(chain, controller, law.certificate)
    if not proof.available:
        output.show(_values(proof, chain), [*_lines(proof, chain), "nothing is exported, as no law is proved"])
        return 1
    step = block_step(chain, proof.law, remarks=(*proof.statement(), *_scope(proof, chain)))
    exported = write_step(step, folder, fmu=fmu, force=force)
    files = {"files": [str(folder / name) for name in (FILES if fmu else FILES[:2])], "premises": []}
    values = exported.to_dict() | files
    output.show(values | {"guarantee": _values(proof, chain)}, export_lines(values))
    return 0


def run_chain(
    chain: "BlockChain", out: Path | None, force: bool, output: Output, formats: Any = ("png",), **entered: Any
) -> int:
    """The commands `design` and `simulate`: a law, its proof, a run and, with a folder, files and a figure."""
    from quakedesign.report.folder import prepare
    from quakedesign.studies.several_blocks import run_of_chain, run_sliding_chain

    if out is not None:
        prepare(out, force=force)
        require_writable(out)
        lock_folder(out)
    with progress() as bar:
        bar("design, proof and run", 0.0)
        if chain.has_state:
            entered |= {"progress": lambda done: bar("run", done)}
        one = run_sliding_chain(chain, **entered) if chain.has_state else run_of_chain(chain, **entered)
    proof: Any = one.proof
    values = _run_values(one)
    lines = [] if proof is None else _lines(proof, chain, one)
    lines += one.lines() if proof is None or not proof.available else []
    if out is not None and one.run is not None:
        from quakedesign.files import whole_folder
        from quakedesign.guarantees.exact.guarantee_files import save_guarantee
        from quakedesign.report.block_figure import block_figure
        from quakedesign.report.drawing import file_names, write_figures, write_results

        with whole_folder(out) as folder:
            if proof is not None:
                save_guarantee(proof, folder / "guarantee.json")
            proved = "" if proof is None else proof.sentence()
            write_figures(folder, {"blocks": block_figure(chain, one.run, proved)}, formats)
            write_results(folder, values)
        files = "results.json, " + ("" if proof is None else "guarantee.json, ") + file_names("blocks", formats)
        lines.append(f"written: {out}/ ({files})")
    output.show(values, lines)
    return 0 if one.safe else 1
