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
# **A laboratory has sheared the gouge of a reservoir fault at two rates. Can the fault slip slowly instead of in earthquakes, and what can be guaranteed?** This page goes from
# a CSV file of velocity steps to a fault file, then to stability, the earthquake cycle and the performance limits of every controller. Then come a controller with a
# guarantee for every a, b and D_c that the record allows, a campaign, and figures for a paper.
#
# The record here is synthetic, with noise, so that the result can be checked; replace it by your own file. The same steps apply to a record of slip weakening
# (`--law exponential-slip-weakening`).

# %%
import tempfile
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from IPython.display import display

# %matplotlib inline
import quakedesign as qd
from quakedesign.fault import friction_law
from quakedesign.identification import save_fault
from quakedesign.report import identification_figure
from quakedesign.report import limits_lines
from quakedesign.simulation import Tide, velocity_step
from quakedesign.studies import natural_run

folder = Path(tempfile.mkdtemp())
truth = {"direct_effect": 0.010, "evolution_effect": 0.014, "critical_slip": 1e-4}
gouge = friction_law("rate-and-state-aging")(reference_coefficient=0.72, reference_rate=1e-6, slowest_rate=1e-12, fastest_rate=1.0, **truth)
lasts, rates, machine = np.array([100.0, 60.0, 300.0, 60.0]), np.array([1e-6, 1e-5, 1e-6, 1e-5]), 2000.0  # s, m/s, 1/m
time = np.arange(520.0)
slid = velocity_step(gouge, machine, list(zip(lasts, rates)), times=time)
load_point = np.interp(time, np.cumsum([0, *lasts]), np.cumsum([0, *lasts * rates]))
friction = slid.friction + 3e-4 * np.random.default_rng(5).standard_normal(len(time))
columns = "time [s],load_point_displacement [um],friction"
np.savetxt(folder / "gouge.csv", np.transpose([time, 1e6 * load_point, friction]), delimiter=",", header=columns, comments="", fmt="%.6f")

# %% [markdown]
# ## Friction and its confidence intervals
# Every parameter has an interval of 95 % confidence. (`quakedesign identify gouge.csv --stiffness 2000 --fault geothermal-fault --out gouge.toml` does the same.)

# %%
found = qd.identify(folder / "gouge.csv", stiffness=machine)
for name, estimate in found.estimates.items():
    print(f"{name:21} {estimate.value:.4g} ({estimate.low:.4g} to {estimate.high:.4g}) {estimate.unit}")
residuals = identification_figure(found)
residuals.savefig(folder / "record.pdf")
display(residuals)

# %% [markdown]
# ## The fault file, its stability and its cycle without control
# The file contains the best fit; its header gives the `spread` of a, b and D_c that covers all values that the record allows. Everything else is that of the preset `geothermal-fault`; for your
# own fault, start from `quakedesign init`.

# %%
save_fault(found, qd.load_fault("geothermal-fault"), folder / "gouge.toml")
fault = qd.load_fault(folder / "gouge.toml")
spread = max(abs(end / e.value - 1) for e in map(found.estimates.get, truth) for end in (e.least, e.most))
spread = Fraction(int(1000 * spread) + 1, 1000)
print(f"unstable: {qd.derive(fault).unstable}; a, b and D_c lie within the best fit ± {float(spread):.1%}")
natural = natural_run(fault)
cycle = natural.cycle
print(f"{natural.outcome.kind}s of magnitude {cycle['magnitude']:.2f}, {1e3 * cycle['slip']:.0f} mm each, up to {natural.natural_peak:.2g} m/s")

# %% [markdown]
# ## Performance limits of every controller
# The limits are theorems about the fault linearised about slow sliding. For the fault they are as accurate as this linearisation.

# %%
limits = qd.limits(fault, stress=15e3, prove=False)
print("\n".join(limits_lines(limits)))

# %% [markdown]
# ## A controller and its guarantee
# The guarantee covers every a, b and D_c that the record allows, and every shear stress disturbance up to 15 kPa: tides are several times smaller.

# %%
design = qd.design(fault, "elqr", stress="15000", spread=spread)
print(design.guarantee.sentence())

# %% [markdown]
# ## Sixteen faults that the record allows
# Each run lasts half a day. a, b and D_c are anywhere within the spread; the stress is sinusoidal with a period of ten hours, any phase, and any amplitude within its bound.

# %%
problem = qd.campaign_problem(fault, design.controller, spread=spread, stress=15e3, stress_period=36e3, duration=43200.0, seed=7)
campaign = qd.run_campaign(problem, 16, folder / "campaign", executor=ThreadPoolExecutor(2), batch=8)
fastest = max(campaign.values("peak_slip_rate"))
print(f"largest slip rate of {len(campaign.results)} runs: {fastest:.3g} m/s; proved bound: {float(design.guarantee.peak_slip_rate):.3g} m/s")

# %% [markdown]
# ## A figure for a paper

# %%
run = qd.simulate(fault, design.controller, duration=86400.0, tide=Tide(amplitude=15e3, period=36e3))
figure, axes = plt.subplots(3, figsize=(3.5, 4.6), layout="constrained")
axes[0].semilogy(natural.time / 3.156e7, natural.slip_rate)
axes[0].set_ylabel("slip rate [m/s]"), axes[0].set_xlabel("time without control [year]")
axes[1].plot(run.time / 3600, 1e9 * run.slip_rate)
axes[1].set_ylabel("slip rate [nm/s]"), axes[1].set_xlabel("time with the controller [h]")
axes[2].plot(run.time / 3600, run.pressure / 1e3)
axes[2].set_ylabel("pressure [kPa]"), axes[2].set_xlabel("time with the controller [h]")
figure.savefig(folder / "gouge.pdf")
plt.show()

# %% [markdown]
# **Result:** an e-LQR measures the slip every 400 s and sets the pressure of a well near the fault. The fault then slips 20 mm in 20 days. It is proved, for every a, b and D_c that the record allows, that the slip rate
# never exceeds the planned rate by more than a quarter. Without control the fault has earthquakes of magnitude 3.5, with slip rates of decimetres per second.

# %%
guarantee = design.guarantee
assert all(e.least < truth[name] < e.most for name, e in found.estimates.items() if name in truth)
assert str(guarantee.check()) == "proved" and all(low <= truth[name] <= high for name, (low, high) in guarantee.task.ranges.items() if name in truth)
assert natural.outcome.kind == "earthquake" and limits.peak_slip_rate_error.impossible_beyond < guarantee.peak_slip_rate
assert set(campaign.kinds["tracked"]) == set(range(16)) and fastest < guarantee.peak_slip_rate < 1.25 * guarantee.task.rate < natural.natural_peak
assert all((folder / name).read_bytes().startswith(b"%PDF") for name in ("record.pdf", "gouge.pdf"))
