# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Certificates: read one, check one, break one
#
# A certificate is a text file with a Lyapunov function and rational numbers that prove it. This page opens one and verifies it with two programs
# that share no code. It then changes single numbers, whereupon both reject the file, and ends with a user-defined law.

# %%
import dataclasses
import json
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import sympy as sp
from IPython.display import display

import quakedesign as qd
from quakedesign.lyapunov import certificate_text

PROOFS = next(base / "proofs" for base in Path(qd.__file__).parents if (base / "proofs").is_dir())
path = PROOFS / "certificates" / "cta_7_5_2.3_1.1.json"
certificate = qd.load_certificate(path)

# %% [markdown]
# ## What it says
# The 2-CTA with gains from the literature, for $|\dot h| \le 1$ and $\beta = 1$. On every sign cell of the errors the signed powers become polynomials
# (here $e_1 = \pm u_1^3$, $e_2 = \pm u_2^2$, $e_3 = \pm u_3$ with $u_i \ge 0$; $e_3$ is the integral state plus $h$), so that "$V$ is positive" and "$V$ decreases" are statements about polynomials.

# %%
((verdict, lines),) = qd.check_files([path]).values()
print(verdict)
print("\n".join(lines))

# %% [markdown]
# `positive` is $\varepsilon$ in $V \ge \varepsilon\sum u_i^5$, `decrease` is $\varepsilon'$ in $\dot V \le -\varepsilon'\sum u_i^4$. `bound_…` bound every error by $V$, and `decay` is
# $\kappa$ in $\dot V \le -\kappa V^{4/5}$: the origin is reached within $\frac{5}{\kappa}V(0)^{1/5}$.

# %%
from quakedesign.lyapunov import settling

print(f"settles from |e_i| <= 1 within {settling(certificate, 1).seconds:.3g} s")

# %% [markdown]
# ## What proves it
# Every polynomial has a witness: squares times products of the variables, as matrices that must be positive definite.

# %%
raw = json.loads(path.read_text())
witness = next(w for w in raw["witnesses"] if w["obligation"].startswith("decrease"))
print(witness["obligation"])
for square in witness["squares"]:
    print("times", square["times"], "basis", square["basis"], "gram", square["gram"][0], "…")

# %% [markdown]
# ## Two checkers
# `quakedesign check` derives the field from the law again. `proofs/check.py` needs only Python, and says what it did not verify.


# %%
def verdicts(file: Path) -> tuple[str, str]:
    """First words of both checkers."""
    ((own, _),) = qd.check_files([file]).values()
    call = [sys.executable, str(PROOFS / "check.py"), str(file)]
    other = subprocess.run(call, capture_output=True, text=True, check=False).stdout.splitlines()[0]
    return own.split(":")[0], other.rsplit(f"{file.name}: ", 1)[1].split(":")[0]


both = verdicts(path)
display(both)

# %% [markdown]
# ## Break it
# One entry of one matrix, one gain, one coefficient of $V$, one claim, the range of $\dot h$. Each is changed by a thousandth.


# %%
def changed(edit) -> tuple[str, str]:
    """Verdicts on a copy with one change."""
    copy = json.loads(path.read_text())
    edit(copy)
    file = Path("changed.json")
    file.write_text(json.dumps(copy))
    try:
        return verdicts(file)
    finally:
        file.unlink()


def larger(text: str) -> str:
    """A number a thousandth larger."""
    return str(Fraction(text) * Fraction(1001, 1000))


def edit_gram(copy):
    gram = copy["witnesses"][-1]["squares"][0]["gram"]
    gram[0] = larger(gram[0])


def edit_gain(copy):
    copy["gains"]["k1"] = larger(copy["gains"]["k1"])


def edit_function(copy):
    copy["V"][0][0] = larger(copy["V"][0][0])


def edit_claim(copy):
    copy["claims"]["decay"] = larger(copy["claims"]["decay"])


def edit_range(copy):
    copy["uncertain"]["d"] = [larger(end) for end in copy["uncertain"]["d"]]


broken = {edit.__name__: changed(edit) for edit in (edit_gram, edit_gain, edit_function, edit_claim, edit_range)}
display(broken)

# %% [markdown]
# ## A user-defined law with a nested power
# $\nu = -k_2\lceil e_1 + k_1\lceil e_2\rfloor^{3/2}\rfloor^{1/3} + \xi$, $\dot\xi = -k_3\lceil e_1\rfloor^0$. Only the field is given. An additional variable replaces the nested power, candidates for $V$ follow from
# weights and degree, and the same call proves the gains.

# %%
from quakedesign.laws import LoopField
from quakedesign.symbolic import SignedPower

e1, e2, e3, k1, k2, k3, beta, d = sp.symbols("e1 e2 e3 k1 k2 k3 beta d", real=True)
inner = e1 + k1 * SignedPower(e2, sp.Rational(3, 2))
mine = LoopField(
    states={e1: 3, e2: 2, e3: 1},
    field={
        e1: e2,
        e2: beta * (e3 - k2 * SignedPower(inner, sp.Rational(1, 3))),
        e3: d - k3 * SignedPower(e1, 0),
    },
    gains=(k1, k2, k3),
    constants=(),
    uncertain=(beta, d),
    domain="cells",
)
own_verdict, own = qd.certify(mine, ("0.5", "8", "2"), lipschitz="1", gain_range=("1", "1.1"))
print(own_verdict, "with lifts", own.loop.lifts)

# %% [markdown]
# The package re-checks the file together with the field, because it has no name for this law. `proofs/check.py` verifies the file alone.

# %%
file = Path("own.json")
own.save(file)
call = [sys.executable, str(PROOFS / "check.py"), str(file)]
outside = subprocess.run(call, capture_output=True, text=True, check=False).stdout
file.unlink()
print(outside)
steeper = dataclasses.replace(own.loop, gains={**own.loop.gains, "k3": Fraction(3)})
try:
    dataclasses.replace(own, loop=steeper).check(mine)
    refused = False
except ValueError:
    refused = True

# %% [markdown]
# What this page claims:

# %%
assert both == ("proved", "proved") and certificate_text(certificate) == path.read_text()
assert all(found == ("invalid", "invalid") for found in broken.values())
assert str(own.check(mine)) == "proved" and outside.startswith("own.json: proved") and refused
