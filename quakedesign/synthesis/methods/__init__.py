"""How laws are designed and judged, one family of laws a file, found by looking into this folder."""
