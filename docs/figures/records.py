"""Draws the figure of the page on laboratory records: python docs/figures/records.py."""

from pathlib import Path

from quakedesign.identification import identify, read_record
from quakedesign.report.identification_page import identification_figure

HERE = Path(__file__).parent
RECORDS = HERE.parents[1] / "tests" / "data" / "records"

identification_figure(identify(read_record(RECORDS / "basalt_7.csv"))).savefig(HERE / "record.png", dpi=100)
