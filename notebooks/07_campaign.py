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
# One run shows one fault. The design has to hold for every fault in the box, every phase of the disturbance and every start that it admits. A campaign
# runs many of them, keeps what is done, and finds the worst.

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
# ## The question
# The laboratory fault for 20 s, with the law as it was designed: sampled every millisecond. Sample i is a point of a scrambled Sobol' sequence and
# depends on the seed and on i alone: stiffness, viscosity, effective area and friction within ±10 %, amplitude and phase of the disturbance.

# %%
problem = campaign_problem(fault, design.controller, duration=20.0, seed=7)
folder = tempfile.TemporaryDirectory()
half = run_campaign(problem, 16, Path(folder.name) / "campaign", executor=ThreadPoolExecutor(2), batch=8)
print(half.quantiles()["max_slip_rate_error"])

# %% [markdown]
# ## Interrupted, and gone on with
# The folder holds one file for each batch. Asking for more samples goes on from those that are there, and so does the same call after any interruption:
# the digits are those of a run that was never interrupted.

# %%
whole = run_campaign(problem, 32, Path(folder.name) / "campaign", executor=ThreadPoolExecutor(2), batch=8)
print("taken from the files:", whole.resumed)
other = tempfile.TemporaryDirectory()
again = run_campaign(problem, 32, Path(other.name) / "campaign", executor=ThreadPoolExecutor(2), batch=16)
same = whole.quantiles() == again.quantiles()
print("the same digits in batches of another size:", same)

# %% [markdown]
# ## The worst samples
# Any of them can be run again by its number, as a trajectory with everything in it. None may leave what is guaranteed for all faults of the box.

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
