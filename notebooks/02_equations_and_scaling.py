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
# # From the force balance to instability and scaling
#
# This page derives the equations from one force balance, and decides stability in exact arithmetic.

# %%
import dataclasses

import sympy as sp
from IPython.display import display

# %matplotlib inline
import quakedesign as qd
from quakedesign.symbolic import homogeneous, plant, weights_for
from quakedesign.symbolic import critical_stiffness, nucleation_length, stability

display(plant.force_balance())

# %% [markdown]
# Relative to the equilibrium without pressure and disturbance, and per unit mass ($x_1$: slip [m], $x_2$: slip rate [m/s]):

# %%
display(plant.shifted_acceleration())

# %% [markdown]
# The Jacobian contains the pressure $p$, because withdrawal ($p<0$) increases the softening. The origin is unstable if **either** inequality holds.

# %%
fault = qd.load_fault("real-fault")
model = qd.derive(fault)
display(model)

# %% [markdown]
# ## A verdict with a margin
# The conditions are evaluated in exact arithmetic; the margin says how far the fault is from the boundary.

# %%
for pressure in ("0", "-20e6", "40e6"):
    verdict = stability(fault, pressure=pressure)
    margin = min(float(condition.margin[0]) for condition in verdict.conditions)
    print(f"p = {float(pressure) / 1e6:5.0f} MPa: {verdict.outcome.name.lower()}, margin {margin:+.3f}")
print(f"critical stiffness {critical_stiffness(fault):.4g} N/m, nucleation length {nucleation_length(fault):.4g} m")

# %%
from quakedesign.report import stability_map

display(stability_map(fault))

# %% [markdown]
# ## User-defined friction
# [own/hyperbolic_friction.py](own/hyperbolic_friction.py) lies outside the package. The same functions accept it.

# %%
from own.hyperbolic_friction import HyperbolicWeakening

mine = dataclasses.replace(fault, friction=HyperbolicWeakening(residual=0.2353, drop=0.1, length=0.5))
print(qd.derive(mine).reasons[0])
print(stability(mine).outcome.name.lower())
display(qd.derive(mine).acceleration)

# %% [markdown]
# ## A user-defined control law
# [own/third_order_law.py](own/third_order_law.py) has signed powers inside a sign function. The weights that make it homogeneous follow from linear equations;
# the degree is then proved by an identity, or refuted by a point.

# %%
from own import third_order_law as law

weights = weights_for(law.field, -1)
found = homogeneous(law.field, weights)
print({str(s): w for s, w in weights.items()}, found.verdict, found.degree)
print(homogeneous(law.field, {law.x1: 1, law.x2: 1, law.x3: 1}).verdict)
display(found)

# %% [markdown]
# ## Scaling
# The dimensionless groups are computed from the units. Two faults are similar if all groups agree; gains then carry over.

# %%
from quakedesign.report import scale_lines
from quakedesign.studies import scale_answer

answer = scale_answer("lab-fault", "real-fault", "cta", "published")
print("\n".join(scale_lines(answer)))

# %%
unstable = {f.name: qd.derive(f).unstable for f in (fault, mine, qd.load_fault("lab-fault"))}
assert found.verdict == "proved" and found.degree == -1 and all(unstable.values()) and answer["similar"]
