"""Files of proofs on the stick–slip plant (proofs/FORMAT.md); numbers are in SI units."""

from fractions import Fraction

from quakedesign.files import Json
from quakedesign.guarantees.exact.file_entries import Powers, TaskEntries, power_entries, powers, task_entries
from quakedesign.guarantees.exact.stick_slip_proof import StickSlipProof
from quakedesign.guarantees.exact.stick_slip_set import SampledStickSlip, StickSlipClaims, StickSlipPolytope
from quakedesign.laws.implicit_root import ImplicitStep
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
    sampled_loop, pull = claim.sampled_loop, power_entries(claim.sampled_loop.law.pull)
    loop = made(
        StickSlipLoopEntries, sampled_loop, sampled_loop.law, pull=pull or None, longest=sampled_loop.longest_step
    )
    return dict(
        written(StickSlipFile(**task_entries(claim.task), loop=loop, set=claim.invariant_set, claims=claim.claims))
    )


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
    pull = () if loop.pull is None else ImplicitStep(pull=powers(loop.pull)).pull
    law = made(StickSlipLaw, loop, pull=pull)
    sampled_loop = made(SampledStickSlip, loop, law=law, longest_step=loop.longest)
    return StickSlipProof(task=task, sampled_loop=sampled_loop, invariant_set=file.set, claims=file.claims)
