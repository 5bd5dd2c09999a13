"""Gains of the e-LQR from Riccati equations, in continuous time and sampled."""
