"""Theorem 1, the sliding-mode laws: what of its proof can be computed. Run: ``python proofs/theorem_1.py``.

V, V̇ and the sets S1, S2 are those of the paper's proof; the derivative is taken here from the control laws themselves.
Beyond the paper: a bound for k̃_I3 in closed form in place of one use of its lemma, and the sharpness of L̄ < k_I3.
"""

from collections.abc import Iterator
from itertools import product

import sympy as sp
from filippov import FilippovField, filippov_derivative, inverse, lie_derivative
from set_valued import restrict
from steps import Step, cited, equal, printed, text, true

from quakedesign.laws import control_law
from quakedesign.symbolic import AbsolutePower, SignedPower, homogeneous, normal_form
from quakedesign.symbolic.enclosure import enclose

R, ONE = sp.Rational, sp.Integer(1)
e1, e2, e3, h = sp.symbols("e_1 e_2 e_3 h", real=True)
rate = sp.Symbol("hdot", real=True)
beta, limit, scale = sp.symbols("beta Lbar lambda", positive=True)
k1, k2, k3, k4 = sp.symbols("k_1:5", positive=True)
kI1, kI2, kI3 = sp.symbols("k_I1 k_I2 k_I3", positive=True)
kI4 = sp.Symbol("k_I4", real=True)
gamma = sp.Symbol("gamma_1", positive=True)
phi1, phi2, phi3 = PHI = sp.symbols("phi_1:4", real=True)
GAINS = {"cta": (k1, k2, k3, k4), "dia": (kI1, kI2, kI3, kI4)}
WEIGHTS = {e1: 3, e2: 2, e3: 1}
PHI_WEIGHTS = {phi1: 3, phi2: 2, phi3: 1}
c = kI1 ** R(-3, 2)
kt2, kt3 = sp.sqrt(kI1) * kI2, kI3 / (sp.sqrt(kI1) * kI2)
S1 = (kI1 ** R(3, 2) * phi1 + SignedPower(phi2, R(3, 2)), phi1)
S2 = (phi2, phi2)


def closed_loop(name: str, gains: tuple = (), factor: sp.Expr = ONE) -> FilippovField:
    """Eq. clsystem1 or clsystem2 from the law itself: e2' = β(ν + h), e3 = ξ1 + h, h' ∈ [−L̄, L̄], with λ = factor."""
    law, chosen = control_law(name), gains or GAINS[name]
    nu = law.virtual_control(e1, e2, e3 - h, chosen, factor)
    integral = law.integral_rate(e1, e2, chosen, factor)
    rates = {e1: e2, e2: sp.expand(beta * sp.expand(nu + h)), e3: sp.expand(integral + rate)}
    return FilippovField(rates=rates, intervals={rate: (-limit, limit)})


def coordinates() -> dict[sp.Symbol, sp.Expr]:
    """φ of the paper's proof, in e."""
    third = e3 / kt2
    return {phi1: e1 - third**3, phi2: e2, phi3: third}


def lyapunov() -> sp.Expr:
    """V(φ) of the paper's proof."""
    powers = R(3, 5) * gamma * AbsolutePower(phi1, R(5, 3)) + R(2, 5) * c * AbsolutePower(phi2, R(5, 2))
    return powers + phi1 * phi2 + AbsolutePower(phi3, 5) / 5


def field() -> FilippovField:
    """2-DIA loop in φ, λ = 1."""
    return closed_loop("dia").transformed(coordinates())


def derivative(*on: tuple[sp.Expr, sp.Symbol]):
    """V̇ along the 2-DIA loop as a set, on the set where conditions vanish."""
    return filippov_derivative(lyapunov(), field(), on)


def first_factor() -> sp.Expr:
    """P(φ): what −k̃_I2·β multiplies in V̇."""
    bend = phi1 + c * SignedPower(phi2, R(3, 2))
    return bend * (SignedPower(bend + phi3**3, R(1, 3)) - phi3)


def printed_derivative() -> sp.Expr:
    """V̇ as the paper states it."""
    slope = gamma * SignedPower(phi1, R(2, 3)) + phi2
    bracket = SignedPower(phi3, 4) - 3 * phi3**2 * slope
    switch = SignedPower(phi1 + phi3**3 + kI4 * SignedPower(phi2, R(3, 2)), 0) - rate / kI3
    return -kt2 * beta * first_factor() + slope * phi2 - kt3 * bracket * switch


def on_cells(expression: sp.Expr) -> Iterator[sp.Expr]:
    """Expression on every cell |φ2| = b², |φ3| = q, with the nested cube root, of size p, as a variable for φ1."""
    p, q, b = sp.symbols("p q b", nonnegative=True)
    for s2, s3, root in product((1, -1), repeat=3):
        cube = (root * p) ** 3 - phi3**3 - c * SignedPower(phi2, R(3, 2))
        yield normal_form(expression.subs(phi1, cube).subs({phi2: s2 * b**2, phi3: s3 * q}))


def printed_on_s1() -> sp.Expr:
    """V̇ on S1 as the paper states it, with h' in place of its bound."""
    g = gamma / kI1 - 1
    switch = SignedPower((kI4 - c) * SignedPower(phi2, R(3, 2)) + phi3**3, 0) - rate / kI3
    return -g * phi2**2 - kt3 * phi3**2 * (3 * g * phi2 + SignedPower(phi3, 2)) * switch


def homogeneity_steps() -> Iterator[Step]:
    """Both loops are homogeneous inclusions."""
    for name in GAINS:
        law, loop = control_law(name), closed_loop(name)
        answer = homogeneous(loop.rates, WEIGHTS)
        surfaces = ", ".join(f"{text(p)} (degree {m})" for p, m in answer.switching)
        shown = f"weights (3, 2, 1), degree {answer.degree}; switching surfaces {surfaces}"
        yield true(
            f"The {law.title} loop is a homogeneous inclusion.", answer and answer.degree == -1, shown, "identity"
        )


def scaling_steps() -> Iterator[Step]:
    """z = λe carries a loop onto itself with λ-scaled gains and a λ-fold bound on h'."""
    z = dict(zip(sp.symbols("z_1:4", real=True), (e1, e2, e3), strict=True))
    back = dict(z)
    for name in GAINS:
        moved = closed_loop(name).transformed({new: scale * old for new, old in z.items()})
        wanted = closed_loop(name, factor=scale)
        rest = [
            normal_form(moved.rates[new].subs(back, simultaneous=True) - wanted.rates[old].subs(rate, scale * rate))
            for new, old in z.items()
        ]
        title = control_law(name).title
        shown = f"ż2 = {text(wanted.rates[e2])}\nż3 = {text(wanted.rates[e3].subs(rate, scale * rate))}   (z written e)"
        yield true(
            f"z = λe turns the {title} loop into the one scaled by λ, with λh'.", rest == [0, 0, 0], shown, "identity"
        )
    mapped = {
        "cta": (scale ** R(2, 3) * k1, scale ** R(1, 2) * k2, scale * k3, scale * k4),
        "dia": (scale ** R(1, 3) * kI1, scale ** R(1, 2) * kI2, scale * kI3, scale ** R(-1, 2) * kI4),
    }
    for name, gains in mapped.items():
        once, law = closed_loop(name, gains), closed_loop(name, factor=scale)
        same = all(normal_form(once.rates[s] - law.rates[s]) == 0 for s in WEIGHTS)
        claim = f"The law with λ is the law without, at the {control_law(name).title} gains"
        yield true(claim, same, ", ".join(map(text, gains)), "identity")
    yield exponent_step()


def exponent_step() -> Step:
    """λ^{1/3} inside the nested power (as printed in the closed loop) is no scaling: ERRATA 5."""
    point = {e1: sp.Integer(1), e2: sp.Integer(1), e3: sp.Integer(0), beta: 1, kI1: 1, kI2: 1, scale: 64}
    inner = SignedPower(e2, R(3, 2)) + scale ** R(1, 3) * kI1 ** R(3, 2) * e1
    misprint = beta * (-(scale ** R(1, 2)) * kI2 * SignedPower(inner, R(1, 3)) + e3)
    true_rate = scale * closed_loop("dia").rates[e2].subs({s: s / scale for s in WEIGHTS}, simultaneous=True)
    values = [side.subs(point, simultaneous=True) for side in (true_rate, misprint)]
    shown = f"at z = (1, 1, 0), λ = 64, all else 1: {values[0]} against {values[1]}"
    different = not enclose(values[0] - values[1], {}).contains(0)
    return true("With λ^(1/3) inside the 2-DIA's nested power the loops differ (ERRATA 5).", different, shown, "point")


def positivity_steps() -> Iterator[Step]:
    """γ1 > k_I1 if and only if V > 0 off the origin."""
    a, b, w = sp.symbols("a b w", nonnegative=True)
    root, gap = sp.symbols("kappa g", positive=True)
    V = lyapunov().subs(kI1, root**2)
    cells = {
        signs: normal_form(V.subs({x: s * size for x, s, size in zip(PHI, signs, (a**3, b**2, w), strict=True)}))
        for signs in product((1, -1), repeat=3)
    }
    mixed = cells[1, -1, 1]
    claim = "On the cells |φ1| = a³, |φ2| = b², |φ3| = w, κ = √k_I1, V is one of two forms of degree 5."
    other = mixed + 2 * a**3 * b**2
    two = all(sp.expand(p - (mixed if signs[0] != signs[1] else other)) == 0 for signs, p in cells.items())
    yield true(claim, two, f"φ1φ2 ≤ 0: V = {text(mixed)}\nφ1φ2 ≥ 0: 2a³b² more", "identity")
    square = (b - root * a) ** 2 * (2 * b**3 + 4 * root * a * b**2 + 6 * root**2 * a**2 * b + 3 * root**3 * a**3)
    form = R(3, 5) * (gamma - root**2) * a**5 + square / (5 * root**3) + w**5 / 5
    yield equal("The smaller form is a sum of non-negative parts when γ1 ≥ κ².", mixed, form)
    parts = [x.subs(gamma, root**2 + gap) for x in sp.Add.make_args(form)]
    claim = (
        "For γ1 > k_I1 no part is negative, and the sum vanishes only at the origin: a = 0 from the first part, then"
    )
    yield true(claim, all(part.is_nonnegative for part in parts), f"γ1 − k_I1 = {text(gap)} > 0: {text(sum(parts))}")
    yield equal("V at a = 0, positive unless b = w = 0:", form.subs(a, 0), R(2, 5) * b**5 / root**3 + w**5 / 5)
    value = lyapunov().subs({phi1: 1, phi2: -kI1, phi3: 0})
    claim = "For γ1 ≤ k_I1 it is not: V ≤ 0 at φ = (1, −k_I1, 0). So γ1 > k_I1 is necessary and sufficient."
    yield equal(claim, value, R(3, 5) * (gamma - kI1))


def derivative_steps() -> Iterator[Step]:
    """Coordinates, V̇, and the sign of its first part."""
    back = inverse(coordinates(), (e1, e2, e3))
    shown = "\n".join(f"{s} = {text(x)}" for s, x in back.items())
    yield true(
        "φ is a change of coordinates, with a continuously differentiable inverse.", len(back) == 3, shown, "identity"
    )
    degree = homogeneous(lyapunov(), PHI_WEIGHTS)
    claim = "V is continuously differentiable and homogeneous with weights (3, 2, 1)."
    yield true(claim, degree and degree.degree == 5, f"V = {text(lyapunov())}\ndegree {degree.degree}", "identity")
    claim = "V̇, differentiated along the loop in φ, is the expression of the paper."
    yield equal(claim, derivative().expression, printed_derivative())
    parts = (first_factor(), derivative().expression + beta * kt2 * first_factor())
    claim = "Both parts of V̇, −k̃_I2 β P(φ) and the rest, are homogeneous of degree 4."
    yield true(claim, all(homogeneous(e, PHI_WEIGHTS, 4) for e in parts), f"P = {text(first_factor())}", "identity")
    p, q = sp.symbols("p q", real=True)
    claim = "P ≥ 0: with p³ = φ1 + k_I1^(−3/2)⌈φ2⌋^(3/2) + φ3³ and q = φ3, P is a square times a positive form."
    substituted = first_factor().subs(phi1, p**3 - q**3 - c * SignedPower(phi2, R(3, 2))).subs(phi3, q)
    yield equal(claim, substituted, (p - q) ** 2 * ((p + q / 2) ** 2 + R(3, 4) * q**2))
    zero = restrict(first_factor(), S1).single
    claim = "P = 0 just where p = q, which is S1 = {k_I1^(3/2) φ1 + ⌈φ2⌋^(3/2) = 0}."
    yield true(claim, zero == 0 and sp.expand(p**3 - q**3).subs(p, q) == 0, "p³ − q³ is strictly increasing in p")


def restriction_steps() -> Iterator[Step]:
    """V̇ on S1, and on S1 ∩ S2."""
    on_s1 = derivative(S1)
    yield equal("On S1, β drops out of V̇.", on_s1.expression, printed_on_s1())
    both = derivative(S1, S2)
    yield equal("On S1 ∩ S2 the largest value of V̇ over |h'| ≤ L̄ is", both.upper, -kt3 * phi3**4 * (1 - limit / kI3))
    point = {e1: 1, e2: 0, e3: kt2}
    loop = closed_loop("dia")
    at_bound = FilippovField(rates={s: e.subs(rate, kI3) for s, e in loop.rates.items()})
    (only,) = at_bound.at(point)
    claim = "L̄ < k_I3 is also necessary: for h' = k_I3 the loop rests at a point off the origin, whatever V."
    yield true(claim, all(normal_form(v) == 0 for v in only.values()), "e = (1, 0, k_I1^(1/2) k_I2)", "point")


def small_gain_steps() -> Iterator[Step]:
    """How small k̃_I3 must be for V̇ < 0 on S1, in closed form (the paper: small enough)."""
    g, kappa, ratio, m = sp.symbols("g k_t3 L_t m", positive=True)
    q, r, a, excess = sp.symbols("q r a rho", nonnegative=True)
    pull = 1 + ratio * (2 * a - 1)
    bound = -g * q**2 + 3 * g * kappa * (1 + ratio) * r**2 * q - kappa * (1 - ratio) * r**4
    named = {gamma: kI1 * (1 + g), kI3: kappa * kt2}
    agreeing = normal_form(derivative(S1).expression.subs(named))
    for sign in (1, -1):
        here = agreeing.xreplace({s: sp.Integer(1) for s in agreeing.atoms(SignedPower) if s.args[1] == 0})
        here = here.subs({phi3: r, phi2: sign * q, rate: kappa * kt2 * (1 - pull)})
        slack = (
            3 * g * kappa * r**2 * q * ((1 + pull + ratio) if sign > 0 else 2 * ratio * (1 - a))
            + 2 * kappa * ratio * a * r**4
        )
        claim = (
            f"On S1 with φ3 = r > 0, φ2 = {'q' if sign > 0 else '−q'}, switch +1, h'/k_I3 = L̃(1 − 2a): V̇ ≤ bound, since"
        )
        yield equal(claim, bound - here, slack, f"bound − V̇ = {text(slack)} ≥ 0 for 0 ≤ a ≤ 1\nbound = {text(bound)}")
    edge = kappa * (1 - ratio) - R(9, 4) * g * kappa**2 * (1 + ratio) ** 2
    complete = -g * (q - R(3, 2) * kappa * (1 + ratio) * r**2) ** 2 - edge * r**4
    claim = "That bound is negative off the origin if k̃_I3 < 4(1 − L̃)/(9 g (1 + L̃)²), g = γ1/k_I1 − 1:"
    yield equal(claim, bound, complete)
    worst = -g * q**2 + kappa * (1 + ratio) * r**2 * (3 * g * q + r**2)
    limit_value = (-g + kappa * (1 + ratio) * (3 * g * m + m**2)) * q**2
    claim = (
        "Where the switch opposes φ3, r² = mq − ρ with ρ ≥ 0, m = |k_I4 − k_I1^(−3/2)|^(2/3); V̇ ≤ −gq² + …, negative "
        "if k̃_I3 < g/((1 + L̃)(3gm + m²)):"
    )
    slack = kappa * (1 + ratio) * excess * (3 * g * q + m * q + r**2)
    difference = (limit_value - worst).subs(m, (r**2 + excess) / q)
    yield equal(claim, q * difference, q * slack.subs(m, (r**2 + excess) / q), f"limit − bound = {text(slack)} ≥ 0")
    mirrored = derivative().expression.subs({s: -s for s in (*PHI, rate)}, simultaneous=True)
    yield equal(
        "φ3 < 0 needs no proof of its own: V̇(−φ, −h') = V̇(φ, h').",
        mirrored,
        derivative().expression,
        "odd loop, even V",
    )


def conclusion_steps() -> Iterator[Step]:
    """What is cited, the 2-CTA's V, and what the theorem does not say."""
    yield cited(
        "P ≥ 0 vanishes on S1 only, where the rest of V̇ is negative; so V̇ < 0 off the origin for k̃_I2 b_m large "
        "enough. Choose γ1 > k_I1, L̃ < 1, then k̃_I3, then k̃_I2; k_I3 = k̃_I2 k̃_I3 and L* = L̃ k_I3 follow.",
        "Andrieu, Praly, Astolfi (2008); Cruz-Zavala, Moreno (2017): semicontinuous homogeneous functions",
    )
    yield cited(
        "Asymptotic stability and degree −1 < 0 give finite time.",
        "Levant (2005), Homogeneity approach to high-order sliding mode design",
    )
    alpha = sp.symbols("alpha_1:7", real=True)
    cta = (
        *(AbsolutePower(e1, R(5, 3)), e1 * e2, AbsolutePower(e2, R(5, 2))),
        *(e1 * SignedPower(e3, 2), -e2 * e3**3, AbsolutePower(e3, 5)),
    )
    V = sum((x * part for x, part in zip(alpha, cta, strict=True)), start=sp.Integer(0))
    rate_of_v = lie_derivative(V, closed_loop("cta").rates)
    ok = homogeneous(V, WEIGHTS, 5) and homogeneous(rate_of_v, WEIGHTS, 4)
    claim = (
        "The paper's V for the 2-CTA is C¹, homogeneous of degree 5, its V̇ of degree 4; certificates decide the sign."
    )
    yield true(claim, bool(ok), f"V = {text(V)}", "identity")
    lab = {kI1: 2, kI2: 5, kI3: R(144, 10**6), kI4: 0, gamma: R(201, 100), beta: 1, rate: 0}
    value = printed_derivative().subs(lab).subs({phi1: R(1, 5), phi2: R(1, 5), phi3: 1}, simultaneous=True)
    claim = "The theorem says that gains exist. This V does not certify (2, 5, 1.44e-4, 0) with γ1 = 2.01 (ERRATA 27)."
    yield true(claim, bool(enclose(value, {}) > 0), f"V̇(0.2, 0.2, 1) = +{float(value):.4f} for h' = 0, β = 1", "point")
    claim = "The derived V̇ and the paper's also agree on all sign cells, cube root for cube root, a second method."
    yield true(claim, all(x == 0 for x in on_cells(derivative().expression - printed_derivative())), "", "identity")


def proof() -> list[Step]:
    """All steps, each asserted while it is made."""
    parts = (
        homogeneity_steps,
        scaling_steps,
        derivative_steps,
        positivity_steps,
        restriction_steps,
        small_gain_steps,
        conclusion_steps,
    )
    return [step for part in parts for step in part()]


if __name__ == "__main__":
    print(printed("Theorem 1: the sliding-mode laws reach e = 0 in finite time, for suitable gains", proof()))
