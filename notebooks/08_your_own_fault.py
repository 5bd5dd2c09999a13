# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#       format_version: '1.3'
#       jupytext_version: 1.19.6
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Your own fault, from a record
#
# **A laboratory has recorded how the friction of its gouge weakens with slip. Which controller holds a block of it, and what can be promised?** This page goes from
# a CSV file to a fault file, from there to limits that no controller can beat, to a controller with a guarantee, and to a figure for a paper.
#
# The record here is made up, with noise, so that the answer can be checked; put the name of your own file in its place.

# %%
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

# %matplotlib inline
import quakedesign as qd
from quakedesign.identification import save_fault
from quakedesign.report.identification import identification_figure
from quakedesign.report.limits import limits_lines
from quakedesign.simulation import natural_earthquake

folder = Path(tempfile.mkdtemp())
draw, truth = np.random.default_rng(5), {"residual": 0.40, "drop": 0.17, "critical_slip": 2.5e-3}
slip = np.linspace(0, 2e-2, 400)
friction = truth["residual"] + truth["drop"] * np.exp(-slip / truth["critical_slip"])
columns = [np.linspace(0, 100, 400), 1e3 * slip + 2e-4 * draw.standard_normal(400), friction + 2e-3 * draw.standard_normal(400)]
np.savetxt(folder / "gouge.csv", np.transpose(columns), delimiter=",", header="time [s],slip [mm],friction", comments="", fmt="%.6f")

# %% [markdown]
# ## Friction, with what the record allows
# Every parameter has an interval of 95 % confidence. (`quakedesign identify gouge.csv --law exponential-slip-weakening --normal-stress '100 kPa' --out gouge.toml` does the same.)

# %%
found = qd.identify(folder / "gouge.csv", "exponential-slip-weakening", normal_stress=1e5)
for name, estimate in found.estimates.items():
    print(f"{name:14} {estimate.value:.4g} ({estimate.low:.4g} to {estimate.high:.4g}) {estimate.unit}")
identification_figure(found)

# %% [markdown]
# ## A fault file
# The file holds a friction law and ranges that cover **every** law which the record allows. Everything else is that of the laboratory block; for your own, start
# from `quakedesign init`.

# %%
save_fault(found, qd.load_fault("lab-fault"), folder / "gouge.toml")
fault = qd.load_fault(folder / "gouge.toml")
earthquake = natural_earthquake(fault)
print(f"without control: {1e3 * fault.rest_slip:.2f} mm in one event, up to {earthquake.metrics.peak_slip_rate:.3g} m/s")
print("unstable:", qd.derive(fault).unstable, f"  T_s = {1e3 * fault.sampling_time:g} ms")

# %% [markdown]
# ## What no controller can do
# Proved, each for the class of controllers that is named.

# %%
limits = qd.limits(fault)
print("\n".join(limits_lines(limits)))

# %% [markdown]
# ## A controller, and what is guaranteed

# %%
design = qd.design(fault, "elqr")
print(design.guarantee.sentence())

# %% [markdown]
# ## Sixteen faults of the box
# Friction, disturbance and start within what the record and the file allow, run for ten seconds each.

# %%
problem = qd.campaign_problem(fault, design.controller, duration=10.0, seed=7)
campaign = qd.run_campaign(problem, 16, folder / "campaign", executor=ThreadPoolExecutor(2), batch=8)
rates, errors = campaign.values("max_slip_rate_error"), campaign.values("max_slip_error")
print(f"worst of {len(rates)}: {max(rates):.3g} m/s and {max(errors):.3g} m from the reference")

# %% [markdown]
# ## A figure for a paper

# %%
run = qd.simulate(fault, design.controller, duration=0.5)
figure, (upper, below) = plt.subplots(2, sharex=True, figsize=(3.5, 3.2), layout="constrained")
upper.plot(run.time, 1e9 * run.slip_error)
upper.set_ylabel("slip error [nm]")
below.plot(run.time, run.pressure)
below.set_ylabel("pressure [Pa]"), below.set_xlabel("time [s]")
figure.savefig(folder / "gouge.pdf")
plt.show()

# %% [markdown]
# **The answer:** an e-LQR that samples every millisecond holds every block whose friction the record allows; its slip rate stays below a millimetre per second, proved, where
# the block left alone reaches centimetres per second.

# %%
guarantee = design.guarantee
assert all(e.low < truth[name] < e.high for name, e in found.estimates.items() if name != "critical_slip")
assert found.allows(truth)
assert str(guarantee.check()) == "proved" and guarantee.claims.peak_slip_rate < 1e-3 < 1e-2 < earthquake.metrics.peak_slip_rate
assert limits.peak_slip_rate_error.impossible_beyond < guarantee.claims.slip_rate_error
assert max(rates) <= guarantee.claims.slip_rate_error and max(errors) <= guarantee.claims.slip_error
assert (folder / "gouge.pdf").read_bytes().startswith(b"%PDF")
