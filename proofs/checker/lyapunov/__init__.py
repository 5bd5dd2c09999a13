"""Closed loops: proofs of stability by a Lyapunov function, and refutations."""
