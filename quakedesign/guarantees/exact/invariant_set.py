"""Invariant polytope of a loop with aperiodic sampling, verified in ball arithmetic.

**Loop.** Each sampling interval T is arbitrary within T_s ≤ T ≤ T_m; all else is as with periodic sampling, and the law
does not measure T. Let the map of a sample be J = CB, B its reduced row echelon form without rows of zeros and C its
columns at B's pivots. With x₋ the state just before a sample, the sample retains only ξ = Bx₋. At a time θ after it,
x(θ) = e^{Aθ}(Cξ + Σ j·n) + ∫₀^θ e^{Aσ}Σ b_i·w_i dσ, n the sampled inputs.

**Theorem.** Let X = {ξ: |h_l·ξ| ≤ 1 for all l}, 0 ∈ X, and let |w_i| ≤ W_i for every input. Suppose |h_l·Bx(T)| ≤ 1 for
all l and T_s ≤ T ≤ T_m, and |c_y·x(θ)| ≤ Y_y for 0 ≤ θ ≤ T_m, for all ξ ∈ X and all such inputs. If W_i ≥ F_i + Σ_y
c_iy·Y_y for every input, with F_i and c_iy as in `small_gain`, then for the initial state 0, |y| ≤ Y_y for every output
y and all t.

**Proof.** By induction ξ stays in X while the inputs obey their bounds. Along a trajectory of the loop, s, w, β and φ
are functions of time, and for these functions the inputs are linear in the state. Saturate the inputs at ±W_i: a
solution of this loop obeys all bounds of the inputs for all t, hence |y| ≤ Y_y for all t. So no input saturates, and
this is the unique solution of the original loop. ∎

**What is verified.** Let ξ have r entries, L name r independent facets, H_L have the rows h_l, l ∈ L, and 1 be a column
of ones. Then |gξ| ≤ |gH_L⁻¹|·1 on X for every row g. A file names r facets for every row g at every end of a piece. For
c = h_l·B on [T_s, T_m], and for an output c on [0, T_m], let f(θ) = |ce^{Aθ}(Cξ + Σ j·n)| + Σ W_i∫₀^θ|ce^{Aσ}b_i|dσ. On
a piece [α, β] the first term exceeds the linear interpolation of its two end values by at most (β −
α)²/8·max|cA²e^{Aσ}||x(0)|, and the second by at most (β − α)²/8·Σ W_i·max|cAe^{Aσ}b_i|: f is at most the larger of its
two end values plus both of these bounds. Integrals are trapezoidal sums, as in `norms`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, reduce
from itertools import pairwise

from flint import arb, arb_mat, ctx, fmpq, fmpq_mat

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import shortly
from quakedesign.guarantees.exact.norms import BALLS, Arithmetic, absolute, ball, column, hstack, matrix, upper
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sampled_loop import Channel, SampledLoop, channels_of
from quakedesign.guarantees.exact.small_gain import Bounds, shift_bound
from quakedesign.loop import PeriodicLoop
from quakedesign.plant.fault_plant import FaultPlant

_BITS, _ZERO = 128, Fraction(0)
SOONEST = 4  # pieces of the shortest interval, for integrals
MOST_FACETS = 400
MOST_PIECES = 32
MOST_SIZE, MOST_BASES, LARGEST = 6, 4000, 10**20  # limits: entries of a facet, bases in all, size of numbers
Basis = tuple[int, ...]
Row = tuple[Fraction, ...]


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class InvariantPolytope:
    """Invariant polytope, bounds of the inputs, and the facets that bound each row.

    Attributes
    ----------
    inputs : tuple of Fraction
        W_i, in the units and the order of `channels_of`.
    facets : tuple of rows
        h_l, of r entries each.
    at_samples : tuple of tuple of Basis
        For every facet, zero-based indices of r facets at each end of equal pieces of [T_s, T_m].
    between : tuple of tuple of Basis
        The same for every output on [0, T_m].

    Raises
    ------
    ParameterError
        When the dimensions do not match.
    """

    inputs: Row
    facets: tuple[Row, ...]
    at_samples: tuple[tuple[Basis, ...], ...]
    between: tuple[tuple[Basis, ...], ...]

    def __post_init__(self) -> None:
        size, count = len(self.facets[0]) if self.facets else 0, len(self.facets)
        bases = [basis for table in (self.at_samples, self.between) for of_facet in table for basis in of_facet]
        sizes = sorted({len(row) for row in self.facets})
        large = [v for row in self.facets for v in row if max(abs(v.numerator), v.denominator) >= LARGEST]
        outside = [basis for basis in bases if len(basis) != size or not all(0 <= i < count for i in basis)]
        negative = [bound for bound in self.inputs if bound < 0]
        conditions: tuple[tuple[str, bool, str], ...] = (
            (
                f"facets must be 1 to {MOST_FACETS} rows, at least as many as entries of a row",
                0 < size <= count <= MOST_FACETS,
                f"{count} rows of {size} entries",
            ),
            (f"facets must have at most {MOST_SIZE} entries each", size <= MOST_SIZE, f"{size}"),
            (f"bases must be at most {MOST_BASES} in all", len(bases) <= MOST_BASES, f"{len(bases)}"),
            (
                "numerators and denominators of facets must be below 1e20",
                not large,
                "" if not large else f"the entry {shortly(large[0])}, whose numerator or denominator is larger",
            ),
            ("facets must have the same number of entries", len(sizes) == 1, f"rows of {_listed(sizes)} entries"),
            (
                "at_samples must have one row for each facet",
                len(self.at_samples) == count,
                f"{len(self.at_samples)} rows for {count} facets",
            ),
            *(
                (
                    f"rows of {name} must have the same number of bases, 2 to {MOST_PIECES + 1},",
                    _even(table),
                    f"rows of {_listed(sorted({len(of_facet) for of_facet in table}))} bases",
                )
                for name, table in (("at_samples", self.at_samples), ("between", self.between))
            ),
            (
                f"a basis must be {size} indices of facets, each at least 0 and below {count}",
                not outside,
                "" if not outside else f"{outside[0]}",
            ),
            (
                "bounds of the inputs must be given, and each must be 0 or more,",
                bool(self.inputs) and not negative,
                shortly(negative[0]) if negative else "none",
            ),
        )
        for condition, satisfied, received in conditions:
            if not satisfied:
                raise ParameterError(f"{condition} in an invariant set. Received {received}. Search for the set again.")


def _listed(numbers: list[int]) -> str:
    return ", ".join(map(str, numbers)) or "no"


def _even(table: tuple[tuple[Basis, ...], ...]) -> bool:
    """Whether all rows have the same number of bases, 2 to `MOST_PIECES` + 1."""
    return len({len(row) for row in table}) == 1 and 2 <= len(table[0]) <= MOST_PIECES + 1


def reached_bounds(task: FaultPlant, sampled_loop: SampledLoop, invariant_set: InvariantPolytope) -> Bounds | NoProof:
    """Bounds of the theorem, or the condition that fails."""
    loop, channels = sampled_loop.loop(task), channels_of(task, None, sampled_loop.step, sampled_loop.noise)
    with ctx.workprec(_BITS):
        try:
            outputs = _SampleMap.of(loop, channels, invariant_set).outputs(
                sampled_loop.step, sampled_loop.longest_step, invariant_set
            )
        except ParameterError as error:
            return NoProof(reason=str(error))
    largest = dict(zip(loop.outputs, outputs, strict=True))
    shares = [sum((c * largest[y] for y, c in channel.coefficients.items()), _ZERO) for channel in channels]
    for channel, share, bound in zip(channels, shares, invariant_set.inputs, strict=True):
        if channel.constant + share > bound:
            return NoProof(reason=f"the {channel.name} may exceed its bound in the invariant set")
    gains = (share / bound for share, bound in zip(shares, invariant_set.inputs, strict=True) if bound)
    return Bounds(
        slip_error=largest["slip_error"],
        slip_rate_error=largest["slip_rate_error"],
        push=largest["push"] + shift_bound(task),
        small_gain=max(gains, default=_ZERO),
    )


@dataclass(frozen=True)
class BetweenSamples:
    """Flow from one sample to the next, for rows of the state and columns of inputs."""

    by: Arithmetic
    flow: arb_mat
    inputs: arb_mat
    cached: dict[Fraction, tuple[arb_mat, arb_mat]] = field(default_factory=dict)

    def along(
        self, rows: arb_mat, ends: Sequence[Fraction], first: int, largest: arb_mat, bounds: list[arb]
    ) -> Iterator[tuple[arb_mat, arb_mat, arb_mat]]:
        """At each end from `first` on: rows, contribution of bounded inputs, and excess within the next piece.

        `largest` bounds the state right after a sample, entry by entry; no piece follows the last end.
        """
        by, area, sizes = self.by, rows * (self.flow * 0) * largest, self.by.absolute(self.inputs)
        for i, piece in enumerate(b - a for a, b in pairwise(ends)):
            step, within = self._step(piece)
            h, following, bent = by.number(piece), rows * step, by.absolute(rows * self.flow * self.flow) * within
            if i >= first:
                slope = by.scaled(by.absolute(rows * self.flow) * within * sizes, bounds)
                yield rows, area, by.sums(by.hstack([bent * largest, slope])) * h**2 / 8
            heights = by.modulus(rows * self.inputs) + by.modulus(following * self.inputs)
            area = area + by.sums(by.scaled(heights * h / 2 + bent * sizes * h**3 / 12, bounds))
            rows = following
        yield rows, area, area  # no piece follows

    def _step(self, piece: Fraction) -> tuple[arb_mat, arb_mat]:
        """e^{Ah} and an upper bound of |e^{Aσ}|, 0 ≤ σ ≤ h."""
        if piece not in self.cached:
            h = self.by.number(piece)
            self.cached[piece] = (self.flow * h).exp(), self.by.absolute((self.by.majorant(self.flow) * h).exp())
        return self.cached[piece]


@dataclass(frozen=True)
class _SampleMap:
    """Map from one sample to the next: B, C, H, output rows, inputs of the flow and of samples, with their bounds."""

    flow: BetweenSamples
    seen: arb_mat
    lift: arb_mat
    facets: fmpq_mat
    rows: arb_mat
    bounds: list[arb]
    sampled: list[tuple[arb_mat, arb]]

    @classmethod
    def of(cls, loop: PeriodicLoop, channels: Sequence[Channel], invariant_set: InvariantPolytope) -> "_SampleMap":
        """Map for a loop with one jump, and a set of matching size."""
        seen, lift = reduced(loop.segments[0].jump)
        bounds = {channel.name: ball(bound) for channel, bound in zip(channels, invariant_set.inputs, strict=True)}
        return cls(
            flow=BetweenSamples(BALLS, matrix(loop.flow), hstack([column(v) for v in loop.inputs.values()])),
            seen=arb_mat(seen),
            lift=arb_mat(lift),
            facets=_exact(invariant_set.facets),
            rows=matrix(tuple(loop.outputs.values())),
            bounds=[bounds[name] for name in loop.inputs],
            sampled=[(column(entry), bounds[name]) for name, entry in loop.sampled.items()],
        )

    def outputs(self, soonest: Fraction, latest: Fraction, invariant_set: InvariantPolytope) -> list[Fraction]:
        """Y of every output.

        Raises
        ------
        ParameterError
            When the state may leave the set, or facets are not independent.
        """
        ends = [soonest * i / SOONEST for i in range(SOONEST)]
        ends += _cut(soonest, latest, len(invariant_set.at_samples[0]) - 1)
        for number, (facet, bases) in enumerate(
            zip(arb_mat(self.facets).tolist(), invariant_set.at_samples, strict=True)
        ):
            if not self._largest(arb_mat([facet]) * self.seen, ends, bases) <= 1:
                raise ParameterError(f"the state at a sample may leave the set through facet {number}")
        ends = _cut(_ZERO, latest, len(invariant_set.between[0]) - 1)
        rows = zip(self.rows.tolist(), invariant_set.between, strict=True)
        return [upper(self._largest(arb_mat([row]), ends, bases)) for row, bases in rows]

    def _largest(self, row: arb_mat, ends: list[Fraction], bases: tuple[Basis, ...]) -> arb:
        """Bound of |c·x(θ)| from the end to which the first of `bases` belongs, up to the last end."""
        places = self.flow.along(row, ends, len(ends) - len(bases), self._largest_state, self.bounds)
        pieces = [
            (self._height(now, basis) + area[0, 0], more[0, 0])
            for (now, area, more), basis in zip(places, bases, strict=True)
        ]
        peaks = (a.max(b) + more for (a, more), (b, _) in pairwise(pieces))
        return reduce(arb.max, peaks, arb(0)).abs_upper()

    def _height(self, row: arb_mat, basis: Basis) -> arb:
        """Bound of |c·x| right after a sample."""
        size = _sum(absolute(row * self.lift * arb_mat(self._inverse(basis))))
        return sum((abs((row * entry)[0, 0]) * bound for entry, bound in self.sampled), size)

    @cached_property
    def _largest_state(self) -> arb_mat:
        """Bounds of the state right after a sample, entry by entry."""
        frame = absolute(arb_mat(self._inverse(tuple(range(self.facets.ncols())))))
        total = absolute(self.lift) * BALLS.sums(frame)
        for entry, bound in self.sampled:
            total += absolute(entry) * bound
        return total

    def _inverse(self, basis: Basis) -> fmpq_mat:
        try:
            return _rows(self.facets, basis).inv()
        except ZeroDivisionError:
            raise ParameterError(
                f"the facets of a basis must be linearly independent. Received the dependent facets {basis}."
            ) from None


def require_fit(loop: PeriodicLoop, invariant_set: InvariantPolytope) -> None:
    """Reject a set whose sizes differ from those of a loop."""
    sizes = reduced(loop.segments[0].jump)[0].nrows(), len(loop.outputs), len(loop.inputs) + len(loop.sampled)
    stated = len(invariant_set.facets[0]), len(invariant_set.between), len(invariant_set.inputs)
    if sizes != stated:
        raise ParameterError(
            f"an invariant set of this loop must have facets of {sizes[0]} entries, {sizes[1]} outputs and {sizes[2]} "
            f"inputs. Received {stated[0]} entries, {stated[1]} outputs and {stated[2]} inputs. "
            "Search for the set again."
        )


def reduced(jump: Sequence[Row]) -> tuple[fmpq_mat, fmpq_mat]:
    """B and C with J = CB: nonzero rows of the reduced echelon form, and J at their pivots."""
    whole = _exact(jump)
    form, rank = whole.rref()
    rows = form.tolist()[:rank]
    pivots = [next(i for i, v in enumerate(row) if v != 0) for row in rows]
    return fmpq_mat(rows), fmpq_mat([[row[i] for i in pivots] for row in whole.tolist()])


def _exact(rows: Sequence[Row]) -> fmpq_mat:
    return fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in rows])


def _rows(whole: fmpq_mat, places: Basis) -> fmpq_mat:
    rows = whole.tolist()
    return fmpq_mat([rows[i] for i in places])


def _cut(start: Fraction, end: Fraction, pieces: int) -> list[Fraction]:
    return [start + (end - start) * i / pieces for i in range(pieces + 1)]


def _sum(row: arb_mat) -> arb:
    return sum(row.entries(), arb(0))
