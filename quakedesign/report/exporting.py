"""What was exported, in lines for people."""

from typing import Any


def export_lines(answer: dict[str, Any]) -> list[str]:
    """The same for people."""
    measured = ", ".join(f"{name} [{unit}]" for name, unit in answer["measurement"].items())
    lines = [
        *answer["remarks"],
        f"written: {', '.join(answer['files'])}",
        f"every {answer['step']:g} s: {measured} to pressure [Pa]",
    ]
    lines += [f"  {name}: {value}" for name, value in answer["facts"].items()]
    lines += [
        f"premise {p['name']} {'holds' if p['holds'] else 'FAILS'}: required {p['required']:.4g} {p['unit']}, "
        f"given {p['certified']:.4g} {p['unit']}; {p['note']}"
        for p in answer["premises"]
    ]
    return lines
