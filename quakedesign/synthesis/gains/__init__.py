"""Gains found together with their Lyapunov function, for an objective."""
