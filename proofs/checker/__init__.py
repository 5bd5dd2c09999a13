"""What `check.py` verifies files with: numbers, squares, polynomials, closed loops and guarantees (FORMAT.md)."""
