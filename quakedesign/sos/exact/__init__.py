"""The part of the engine that decides: rational arithmetic only, no solver, no floats."""
