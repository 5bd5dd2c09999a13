"""A polynomial field and a Lyapunov function from a TOML file."""

from pathlib import Path

from quakedesign.errors import PolynomialError
from quakedesign.input import parse_toml, read_text

_LARGEST = 1 << 16  # bytes


def read_field(path: str | Path) -> tuple[dict[str, str], str | None]:
    """Rates of the states by name, from the table ``field``, and V where the file has one; all as text.

    Raises
    ------
    PolynomialError
        When the file cannot be read, or has other contents.
    """
    content = read_text(path, "a field's file", largest=_LARGEST, refusal=PolynomialError)
    try:
        raw = parse_toml(content)
    except ValueError as error:
        reason = str(error).partition("\n")[0]
        raise PolynomialError(f"{path} must be TOML. Received: {reason}. Quote polynomials.") from None
    field, function = raw.get("field"), raw.get("V")
    texts = isinstance(field, dict) and all(isinstance(rate, str) for rate in field.values())
    if not raw.keys() <= {"field", "V"} or not texts or not isinstance(function, str | None):
        raise PolynomialError(
            f'{path} must have a table [field], such as x = "-x + x^3", and at most V = "x^2" before it.'
        )
    return dict(field or {}), function
