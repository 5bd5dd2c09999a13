"""Exact checks of proofs about polynomials, in rational arithmetic, without solver or floating point."""
