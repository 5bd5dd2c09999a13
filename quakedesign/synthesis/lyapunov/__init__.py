"""Lyapunov functions of given gains: candidates, search, exact finish, decay rate, and proofs that there are none."""
