"""From floating-point Gram matrices to exact witnesses."""

from collections.abc import Sequence
from fractions import Fraction

from quakedesign.rationals import nearest
from quakedesign.sos.exact.witness import Block, Polynomial, Witness, expand, proves
from quakedesign.sos.solve.cone import Cone
from quakedesign.sos.solve.search import GramSearch

_BITS = (12, 18, 24, 32, 44)


def find_witness(polynomial: Polynomial, search: GramSearch, scale: Sequence[Fraction]) -> Witness | None:
    """Exact witness for a form, or None.

    Parameters
    ----------
    polynomial : mapping of exponents to Fraction
        Form of the cone's degree.
    search : GramSearch
    scale : sequence of Fraction
        The solver sees the form in ũ with u_i = scale_i·ũ_i; the witness is for u.

    Returns
    -------
    Witness or None
        Verified by `proves`, with the coarsest rounding that works.
    """
    cone = search.cone
    if not polynomial:
        return Witness(multiplier={(0,) * cone.variables: Fraction(1)})
    if all(len(entries) == 1 for entries in cone.positions.values()):
        grams: list | None = [[[0.0] * len(basis) for _ in basis] for _, basis in cone.blocks]
    else:
        grams = search(scaled(polynomial, scale))
    if grams is None:
        return None
    largest = max(abs(float(c)) for c in scaled(polynomial, scale).values())
    for bits in _BITS:
        denominator = max(1, round(2**bits / largest)) if largest < 2**bits else 1
        rounded = [[[nearest(float(v), denominator) for v in row] for row in gram] for gram in grams]
        blocks = _absorb(scaled(polynomial, scale), cone, rounded)
        back = tuple(_unscaled(b, scale) for b in blocks)
        witness = Witness(multiplier={(0,) * cone.variables: Fraction(1)}, blocks=back)
        if proves(polynomial, witness, orthant=cone.orthant):
            return witness
    return None


def scaled(
    polynomial: Polynomial, scale: Sequence[Fraction], factor: Fraction = Fraction(1)
) -> dict[tuple[int, ...], Fraction]:
    """factor · P(scale ∘ u)."""
    return {e: c * factor * monomial(scale, e) for e, c in polynomial.items()}


def monomial(values: Sequence[Fraction], exponents: Sequence[int]) -> Fraction:
    """Π values_i^exponents_i."""
    product = Fraction(1)
    for v, e in zip(values, exponents, strict=True):
        product *= Fraction(v) ** e
    return product


def _absorb(polynomial: Polynomial, cone: Cone, rounded: list) -> list[Block]:
    """Spread the exact residual evenly over the Gram entries of each monomial."""
    blocks = [_block(times, basis, gram) for (times, basis), gram in zip(cone.blocks, rounded, strict=True)]
    residual = dict(polynomial)
    for block in blocks:
        for e, c in expand(block).items():
            residual[e] = residual.get(e, Fraction(0)) - c
    for e, c in residual.items():
        entries = cone.positions[e]
        share = c / sum(1 if i == j else 2 for _, i, j in entries)
        for k, i, j in entries if c else ():
            rounded[k][i][j] += share
            if i != j:
                rounded[k][j][i] += share
    return [_block(times, basis, gram) for (times, basis), gram in zip(cone.blocks, rounded, strict=True)]


def _block(times, basis, gram) -> Block:
    upper = tuple(gram[i][j] for i in range(len(basis)) for j in range(i, len(basis)))
    return Block(times=times, basis=basis, gram=upper)


def _unscaled(block: Block, scale: Sequence[Fraction]) -> Block:
    """Block for u from one for ũ = u/scale."""
    factors = [1 / monomial(scale, b) for b in block.basis]
    outer = 1 / monomial(scale, block.times)
    size = len(factors)
    pairs = ((i, j) for i in range(size) for j in range(i, size))
    gram = tuple(q * factors[i] * factors[j] * outer for q, (i, j) in zip(block.gram, pairs, strict=True))
    return Block(times=block.times, basis=block.basis, gram=gram)
