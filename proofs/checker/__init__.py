"""Modules of `check.py`: numbers, squares, polynomials, closed loops and guarantees (FORMAT.md)."""
