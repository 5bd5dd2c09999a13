"""The part of the engine that decides: rational arithmetic only, no solver, no floats."""

from quakedesign.faces import face

face(__name__)
