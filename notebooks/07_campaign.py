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
# # A campaign over the uncertainty box
#
# One run shows one fault. The design must work for every fault in the box, every phase of the disturbance and every admissible initial condition. A campaign
# simulates many of them, stores the results, and finds the worst.

# %%
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

# %matplotlib inline
import quakedesign as qd
from quakedesign.simulation.campaign import campaign_problem, run_campaign

fault = qd.load_fault("lab-fault", box="ten-percent")
design = qd.design(fault, "cta")
print(design.verdict, {name: f"{float(value):.4g}" for name, value in design.gains.items()})

# %% [markdown]
# ## The problem
# The laboratory fault is simulated for 20 s with the designed law, T_s = 1 ms. Sample i of the campaign is a point of a scrambled Sobol' sequence and
# depends on the seed and on i alone. It varies stiffness, damping and area per mass within ±10 %, the friction drop, and amplitude and phase of the disturbance.

# %%
problem = campaign_problem(fault, design.controller, duration=20.0, seed=7)
folder = tempfile.TemporaryDirectory()
half = run_campaign(problem, 16, Path(folder.name) / "campaign", executor=ThreadPoolExecutor(2), batch=8)
print(half.quantiles()["max_slip_rate_error"])

# %% [markdown]
# ## Interruption and continuation
# The folder contains one file for each batch. A call for more samples continues from the stored ones, and so does the same call after any interruption.
# The results are bitwise those of an uninterrupted run.

# %%
whole = run_campaign(problem, 32, Path(folder.name) / "campaign", executor=ThreadPoolExecutor(2), batch=8)
print("taken from the files:", whole.resumed)
other = tempfile.TemporaryDirectory()
again = run_campaign(problem, 32, Path(other.name) / "campaign", executor=ThreadPoolExecutor(2), batch=16)
same = whole.quantiles() == again.quantiles()
print("bitwise equal with another batch size:", same)

# %% [markdown]
# ## The worst samples
# Any sample can be repeated by its number, as a complete trajectory. None may exceed the bounds that are guaranteed for all faults of the box.

# %%
metric = "max_slip_rate_error"
worst = whole.worst(metric)
print(worst, f"guaranteed: {design.guarantee.slip_rate_error:.3g} m/s", sep="\n")
figure = whole.plot()

# %%
values = whole.values(metric)
index = max(range(len(values)), key=lambda i: values[i])
trajectory = whole.trajectory(index)
print(f"sample {index}: {values[index]:.4g} m/s in the campaign, {trajectory.metrics.max_slip_rate_error:.4g} m/s again")

# %% [markdown]
# What this notebook claims:

# %%
assert same and whole.resumed and not whole.failures
assert trajectory.metrics.max_slip_rate_error == values[index] <= design.guarantee.slip_rate_error
