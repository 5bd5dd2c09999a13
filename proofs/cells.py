"""The cells of a closed loop, on which every function of it is a polynomial in u_i = |x_i|^(1/weight)."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain, product
from math import prod

from exact_numbers import Exponents, Polynomial, add, add_scaled, budget, need
from loop import MAX_STATES, Loop, Powers, Term

SignedSum = dict[tuple[tuple[str, ...], Powers, tuple[bool, ...]], Fraction]


def cells_of(choices: Iterable[Sequence[int]]) -> dict[str, Exponents]:
    """Sign cells by label, from the admissible signs of every state."""
    return {"".join("+" if sign > 0 else "-" for sign in signs): signs for signs in product(*choices)}


@dataclass
class Cell:
    """Points where states and lifts have given signs, after what holds there; it grows with every lift.

    `degrees` has an entry for every variable: its index among states and lifts, and the degree of that.
    """

    label: str
    states: int
    signs: Exponents
    degrees: dict[int, int]
    equalities: list[Polynomial]
    inequalities: list[Polynomial]

    def has_interior(self) -> bool:
        """Tell whether signs alone leave points where all variables are positive."""
        one_sign = (len({number > 0 for number in h.values()}) == 1 for h in self.equalities)
        return not any(one_sign) and all(max(g.values()) > 0 for g in self.inequalities)


def whole_space(size: int) -> Cell:
    """Return what takes the place of the cells on reals."""
    return Cell("", size, (1,) * size, dict.fromkeys(range(size), 1), [], [])


def collect(terms: Iterable[Term]) -> SignedSum:
    """Add up terms."""
    total: SignedSum = {}
    for term in terms:
        add(total, (term.uncertain, term.exponents, term.odd), term.number)
    return total


def restrict(function: SignedSum, cell: "Cell", values: dict[str, Fraction]) -> Polynomial:
    """Write a function as a polynomial in u on one cell at one vertex (in x on reals, with all signs +)."""
    total: Polynomial = {}
    for (uncertain, exponents, odd), number in function.items():
        sign = prod(sign for sign, flag in zip(cell.signs, odd, strict=False) if flag)
        powers = [Fraction(exponents[i]) * n for i, n in cell.degrees.items()]
        need(all(power.denominator == 1 for power in powers), "powers of lifts", "integers on cells", "a fraction")
        add(total, tuple(map(int, powers)), sign * number * prod(values[name] for name in uncertain))
    return total


def restrict_to_ends(function: SignedSum, cell: "Cell", loop: Loop, name: str) -> tuple[Polynomial, Polynomial]:
    """Write an argument on one cell with the smallest and the largest coefficients that roots in their ranges give it.

    Every root is at least 0, so that a term is extreme where all its roots are at the same end.
    """
    small: Polynomial = {}
    large: Polynomial = {}
    lower, upper = ({key: ends[i] for key, ends in loop.uncertain.items()} for i in (0, 1))
    for key, number in function.items():
        at_ends = restrict({key: number}, cell, lower), restrict({key: number}, cell, upper)
        (exponents,) = at_ends[1] or [()]
        values = [entry.get(exponents, Fraction(0)) for entry in at_ends]
        add(small, exponents, min(values))
        add(large, exponents, max(values))
    signs = [small.get(e, Fraction(0)) * large.get(e, Fraction(0)) for e in small | large]
    need(all(sign > 0 for sign in signs), name, "with coefficients whose signs the ranges of roots decide", "others")
    return small, large


def degree_of(form: Polynomial, name: str) -> int:
    """Return the degree of a nonzero form."""
    degrees = {sum(exponents) for exponents in form}
    need(len(degrees) == 1 and 0 not in degrees, name, "a form of one degree >= 1", sorted(degrees))
    return degrees.pop()


def widen(polynomials: Iterable[Polynomial], size: int) -> list[Polynomial]:
    """Write polynomials in more variables."""
    return [{(*e, *[0] * (size - len(e))): number for e, number in entry.items()} for entry in polynomials]


def reach_of(form: Polynomial, reaches: dict[int, set[int]], count: int) -> set[int]:
    """Return the states that a lift's argument depends on, after checking that it is zero on a null set only.

    As a polynomial in those states on which no lift in it depends, it has a coefficient without lifts. This is a
    nonzero polynomial in the other states, hence zero on a null set.
    """
    budget.spend(len(form) * MAX_STATES, 0)
    inner = set[int]().union(*(reaches[i] for e in form for i in range(count, len(e)) if e[i]))
    parts = defaultdict[Exponents, set[bool]](set)
    for e in form:
        parts[tuple(0 if i in inner else e[i] for i in range(count))].add(any(e[count:]))
    need({False} in parts.values(), "an argument", "zero on a null set only, by a part without lifts", "another")
    return inner | {i for e in form for i in range(count) if e[i]}


def cells_with_lifts(loop: Loop) -> list[Cell]:
    """Return the cells with an interior; a lift P gives t*w^n = P or, where only its sign occurs, t*P >= 0.

    Where roots in P vary, t*P takes its largest coefficients: the variables are not negative.
    """
    count, degrees, cells = len(loop.weights), dict[str, int](), []
    terms = [*chain(*loop.field.values()), *(term for term in chain(*loop.lifts.values()) if term.number)]
    for i, lift in enumerate(loop.lifts, count):
        need(any(term.odd[i] or term.exponents[i] for term in terms), f"lift {lift}", "used", "one that is not")
    raised = {i for term in terms for i, exponent in enumerate(term.exponents) if exponent}
    arguments = [collect(terms) for terms in loop.lifts.values()]
    for label, signs in cells_of([(1, -1)] * (count + len(arguments))).items():
        cell, reaches = Cell(f" {label}", count, signs, dict.fromkeys(range(count), 1), [], []), dict[int, set[int]]()
        for i, (lift, argument) in enumerate(zip(loop.lifts, arguments, strict=True), count):
            (small, form), size = restrict_to_ends(argument, cell, loop, f"lift {lift}"), len(cell.degrees)
            degree = degree_of(form, f"lift {lift}")
            need(degrees.setdefault(lift, degree) == degree, f"lift {lift}", "of one degree on all cells", degree)
            reach = reach_of(form, reaches, count)
            if i in raised:
                need(
                    small == form, f"lift {lift}", "without roots that vary, or used by its sign only", "a power of it"
                )
                reaches[size], cell.degrees[i] = reach, degree
                power: Polynomial = {(*[0] * size, degree): signs[i]}
                cell.equalities.append(add_scaled(power, Fraction(-1), widen([form], size + 1)[0]))
            else:
                cell.inequalities.append(add_scaled({}, Fraction(signs[i]), form if signs[i] > 0 else small))
        if cell.has_interior():
            cells.append(cell)
    return cells
