"""Guarantees: bounds of slip, slip rate and pressure from a fault's data and a controller's matrices."""
