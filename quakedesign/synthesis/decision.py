"""The verdict on given gains of any homogeneous law, of the package or of a user's own."""

from fractions import Fraction

from quakedesign.certificates import Certificate, Loop, Verdict, loop_of
from quakedesign.controllers import LoopField, Subject, law, model_of
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.rationals import rational
from quakedesign.synthesis.lyapunov import find_certificate, refute

Number = str | float | Fraction


def certify(
    subject: Subject,
    gains: tuple[Number, ...],
    *,
    lipschitz: Number,
    gain_range: tuple[Number, Number] = (1, 1),
) -> tuple[Verdict, Certificate | None]:
    """Decide whether gains make the origin finite-time stable for |d| ≤ lipschitz and all β of a range.

    Parameters
    ----------
    subject : str, type of Law or LoopField
        Name of a law of the package, a class of the user's own, or a bare closed loop; uncertain in ``beta`` and ``d``
        or one of them. A certificate for one from outside the package is checked again with ``check(subject)``.
    gains : tuple of number or text
        Exact: decimals, exponents or p/q; order of the law.
    lipschitz : number or text
        L̄ [unit of ν per s], not negative.
    gain_range : tuple of two
        b_m and b_M [-], positive.

    Returns
    -------
    verdict : Verdict
    certificate : Certificate or None
        Proof or counterexample; None when undecided.

    Raises
    ------
    ParameterError
        For gains or ranges that are no numbers, a range that is empty or not positive, or a law with other uncertainty.
    UnknownNameError
        For the name of an unknown law.
    """
    try:
        loop = closed_loop(subject, gains, lipschitz=lipschitz, gain_range=gain_range)
        certificate = refute(loop, subject) or find_certificate(loop, subject=subject)
    except CertificateError:
        return Verdict.UNDECIDED, None
    return (certificate.check(subject), certificate) if certificate else (Verdict.UNDECIDED, None)


def closed_loop(
    subject: Subject, gains: tuple[Number, ...], *, lipschitz: Number, gain_range: tuple[Number, Number] = (1, 1)
) -> Loop:
    """Loop with exact gains for |d| ≤ lipschitz and all β of a range.

    Raises
    ------
    ParameterError, UnknownNameError
        As `certify`.
    CertificateError
        When the law has parts that certificates do not know.
    """
    name, model = model_of(subject)
    exact = exact_gains(subject, gains)
    return loop_of(name, model, gains=exact, uncertain=_ranges(name, model, lipschitz, gain_range))


def exact_gains(subject: Subject, gains: tuple[Number, ...]) -> dict[str, Fraction]:
    """Gains by name, exact, in the order of the law.

    Raises
    ------
    ParameterError
        When their number is wrong, or the law refuses them.
    """
    if not isinstance(subject, LoopField):
        chosen = law(subject) if isinstance(subject, str) else subject
        return dict(chosen.from_values(tuple(gains)).gains)
    names = [str(symbol) for symbol in subject.gains]
    if len(gains) != len(names):
        raise ParameterError(f"the loop needs {len(names)} gains ({', '.join(names)}). Received {len(gains)}.")
    return {name: rational(v, f"gain {name}") for name, v in zip(names, gains, strict=True)}


def _ranges(
    name: str, model: LoopField, lipschitz: Number, gain_range: tuple[Number, Number]
) -> dict[str, tuple[Fraction, Fraction]]:
    bound = rational(lipschitz, "lipschitz")
    low, high = (rational(v, "gain_range") for v in gain_range)
    if bound < 0 or not 0 < low <= high:
        raise ParameterError(
            f"lipschitz must not be negative and gain_range must be 0 < b_m <= b_M. Received {bound}, [{low}, {high}]."
        )
    known = {"beta": (low, high), "d": (-bound, bound)}
    unknown = [str(u) for u in (*model.uncertain, *model.constants) if str(u) not in known]
    if unknown or model.domain != "cells":
        raise ParameterError(
            "a Lipschitz bound applies to sliding-mode laws, uncertain in beta and d. "
            f"Received {name!r} with {', '.join(unknown) or 'a polynomial loop'}."
        )
    return {str(u): known[str(u)] for u in model.uncertain}
