"""Tables of numbers as CSV, and numbers of the paper beside ours as lines."""

import csv
import io
from typing import Any


def csv_text(rows: list[dict[str, Any]]) -> str:
    """Rows as CSV with a head line; what does not apply is empty."""
    heads = list(dict.fromkeys(name for row in rows for name in row))
    stream = io.StringIO()
    writer = csv.DictWriter(stream, heads, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def printed_lines(rows: list[dict[str, Any]]) -> list[str]:
    """Printed numbers beside ours, for people; nothing where the paper says nothing of the fault."""
    if not rows:
        return []
    return ["", "printed in the paper, and found here:"] + [
        f"  {row['run']}, {row['metric']}: {row['printed']:.3g} {row['unit']} printed ({row['place']}), "
        f"{row['found']:.3g} found, ratio {row['ratio']:.3g}. {row['note']}"
        if row["ratio"] is not None
        else f"  {row['run']}, {row['metric']}: {row['printed']:.3g} printed ({row['place']}), no run to compare with"
        for row in rows
    ]
