"""Files of proofs on the stick–slip plant (proofs/FORMAT.md)."""

from fractions import Fraction

from quakedesign.files import Json
from quakedesign.guarantees.exact.file_entries import Powers, TaskEntries, power_entries, powers, task_entries
from quakedesign.guarantees.exact.stick_slip_proof import StickSlipProof
from quakedesign.guarantees.exact.stick_slip_set import SampledStickSlip, StickSlipClaims, StickSlipPolytope
from quakedesign.laws.implicit_root import ImplicitRoot
from quakedesign.laws.stick_slip_law import StickSlipLaw
from quakedesign.sos.exact.strict import Entries, made, need, read_as, written


class StickSlipLoopEntries(Entries):
    """The law with its sampling and noise."""

    step: Fraction
    slip_noise: Fraction
    rate_gain: Fraction
    target_gain: Fraction
    return_rate: Fraction
    level_gain: Fraction
    slip_gain: Fraction
    rest_slip: Fraction
    pull: Powers | None = None
    longest: Fraction = Fraction(0)


class StickSlipFile(TaskEntries):
    """Content of a file without its format and kind."""

    loop: StickSlipLoopEntries
    set: StickSlipPolytope
    claims: StickSlipClaims


def stick_slip_entries(claim: StickSlipProof) -> Json:
    """Content of the file for a claim, without format and kind."""
    held, pull = claim.held, power_entries(claim.held.law.pull)
    loop = made(StickSlipLoopEntries, held, held.law, pull=pull or None, longest=held.longest_step)
    return dict(written(StickSlipFile(**task_entries(claim.task), loop=loop, set=claim.reach, claims=claim.claims)))


def read_stick_slip(raw: Json) -> StickSlipProof:
    """Claim from a parsed file without its format and kind.

    Raises
    ------
    CertificateError, ParameterError
        When the file breaks a rule of FORMAT.md.
    """
    file = read_as(StickSlipFile, raw)
    task, loop = file.plant(), file.loop
    need(task.change is None, "a bounded change of the disturbance is not used on the stick-slip plant")
    pull = () if loop.pull is None else ImplicitRoot(pull=powers(loop.pull)).pull
    law = made(StickSlipLaw, loop, pull=pull)
    held = made(SampledStickSlip, loop, law=law, longest_step=loop.longest)
    return StickSlipProof(task=task, held=held, reach=file.set, claims=file.claims)
