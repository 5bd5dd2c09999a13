"""What the commands `fault`, `guarantee`, `design`, `simulate` and `limits` do with a file of several blocks."""

import os
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quakedesign.cli.app import new_file, progress
from quakedesign.cli.options import Output, changed_options
from quakedesign.errors import ParameterError
from quakedesign.files import hold, made_folder, require_room

if TYPE_CHECKING:
    from quakedesign.fault import BlockChain


def several_blocks(
    fault: str, command: Any, options: dict[str, Any], known: Collection[str] = (), box: str | None = None
) -> "BlockChain | None":
    """The blocks of a fault file; None for one without, and for names that are no file.

    Raises
    ------
    ParameterError
        For options that a fault of several blocks does not have.
    """
    from quakedesign.fault import load_chain

    if not str(fault).endswith(".toml") or not os.path.isfile(fault):
        return None
    chain = load_chain(fault, box=box)
    if chain is None:
        return None
    usual = {"fault", "output", "json", "force", "box", *known}
    given = {name: value for name, value in options.items() if value != ()}
    others = [name for name in changed_options(command, given) if name not in usual]
    if others:
        named = ", ".join(f"--{name.replace('_', '-')}" for name in sorted(others))
        raise ParameterError(
            f"{command.__name__} of a fault of several blocks has the options "
            f"{', '.join(f'--{name}' for name in sorted({*known, 'json'}))}. Received {named}. Omit these."
        )
    return chain


def _facts(found: Any) -> dict[str, Any]:
    return found.to_dict() if found.proved else {"verdict": "undecided", "reason": found.reason}


def _lines(found: Any) -> list[str]:
    return found.lines() if found.proved else [found.sentence()]


def show_chain(chain: "BlockChain", output: Output) -> int:
    """The command `fault`."""
    from quakedesign.studies.chains import chain_dict, chain_lines

    output.show(chain_dict(chain), chain_lines(chain))
    return 0


def chain_limits(chain: "BlockChain", output: Output) -> int:
    """The command `limits`."""
    from quakedesign.studies import chains

    found = chains.chain_limits(chain)
    output.show(found.to_dict(), found.lines())
    return 0


def guarantee_chain(chain: "BlockChain", step: Any, out: Path | None, force: bool, output: Output) -> int:
    """The command `guarantee`."""
    from quakedesign.guarantees.exact.guarantee_files import save_guarantee
    from quakedesign.synthesis import guarantee

    if out is not None:
        new_file(out, "certificate file", force=force)
    found: Any = guarantee(chain, step=step)
    if out is not None and found.proved:
        with made_folder(out.parent):
            save_guarantee(found, out)
    unwritten = [f"{out} is not written, as nothing is proved"] if out is not None and not found.proved else []
    written = None if out is None or not found.proved else str(out)
    output.show({**_facts(found), "certificate": written}, [*_lines(found), *unwritten])
    return 0 if found.proved else 1


def run_chain(
    chain: "BlockChain", duration: float | None, out: Path | None, force: bool, output: Output, formats: Any = ("png",)
) -> int:
    """The commands `design` and `simulate`: a law, its proof, a run and, with a folder, files and a figure."""
    from quakedesign.report.folder import prepare
    from quakedesign.simulation.block_run import simulate_blocks
    from quakedesign.synthesis import guarantee

    if out is not None:
        prepare(out, force=force)
        require_room(out)
        hold(out)
    with progress() as tell:
        tell("design and proof", 0.0)
        found: Any = guarantee(chain)
        if not found.proved:
            output.show(_facts(found), [*_lines(found), "nothing is simulated, as no law is proved"])
            return 1
        tell("simulation", 0.5)
        run = simulate_blocks(chain, found.law, duration=duration)
    facts = {"guarantee": found.to_dict(), "run": run.to_dict()}
    said = [
        *found.lines(),
        "",
        f"run over {run.times[-1]:g} s on the stick-slip plant; what is proved is of that without stick:",
    ]
    for i, (slip, rate, rest) in enumerate(zip(run.slip_error, run.slip_rate_error, run.rest, strict=True), 1):
        said.append(f"block {i}: slip error {slip:.3g} m, slip-rate error {rate:.3g} m/s, at rest {100 * rest:.3g} %")
    for event, happened in (("a block would slip backward", run.reversed), ("a block opens", run.opened)):
        said += [f"{event}: the run is outside the model"] if happened else []
    if out is not None:
        from quakedesign.files import whole_folder
        from quakedesign.guarantees.exact.guarantee_files import save_guarantee
        from quakedesign.report.block_figure import block_figure
        from quakedesign.report.drawing import file_names, write_figures, write_results

        with whole_folder(out) as folder:
            save_guarantee(found, folder / "guarantee.json")
            write_figures(folder, {"blocks": block_figure(chain, run, found.sentence())}, formats)
            write_results(folder, facts)
        said.append(f"written: {out}/ (results.json, guarantee.json, {file_names('blocks', formats)})")
    output.show(facts, said)
    return 1 if run.reversed or run.opened else 0
