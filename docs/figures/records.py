"""Draws record.png of the page on laboratory records, and writes steps.csv of the page From a record to a controller.

Run with ``python docs/figures/records.py FOLDER``. The commands of that page, in the folder of steps.csv, then write
the figure overview.svg, which is controlled.svg here.
"""

import sys
from pathlib import Path

import numpy as np

from quakedesign.identification import identify, read_record
from quakedesign.report.identification_page import identification_figure

HERE = Path(__file__).parent
TESTS = HERE.parents[1] / "tests"
HEADING = "time [s], load_point_displacement [um], shear_stress [MPa], normal_stress [MPa]"


def record():
    """A velocity step on basalt (BRAVA b819, step 7)."""
    found = identify(read_record(TESTS / "data" / "records" / "basalt_7.csv"))
    identification_figure(found).savefig(HERE / "record.png", dpi=100)


def steps(folder):
    """Three simulated velocity steps with a = 0.010, b = 0.0135 and D_c = 12 µm, at 5 MPa."""
    sys.path.insert(0, str(TESTS / "identification"))
    import synthetic

    made = synthetic.sliding(
        "rate-and-state-aging", synthetic.STEPS, sample=0.02, a=0.010, b=0.0135, critical_slip=12e-6
    ).noisy(3)
    table = np.column_stack([made.time, made.load_point * 1e6, made.friction * 5, np.full(len(made.time), 5.0)])
    np.savetxt(folder / "steps.csv", table, fmt="%.6g", delimiter=", ", header=HEADING, comments="")


if __name__ == "__main__":
    record()
    steps(Path(sys.argv[1]))
