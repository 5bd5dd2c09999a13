"""Exact part of the engine, which decides in rational arithmetic without solver or floats."""
