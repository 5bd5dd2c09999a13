"""Positivity of polynomials with exact proofs; knows nothing of faults."""

from quakedesign.sos.exact.witness import Block, Polynomial, Witness, proves

__all__ = ["Block", "Polynomial", "Witness", "proves"]
