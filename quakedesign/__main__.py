"""``python -m quakedesign``."""

from quakedesign.cli import main

main()
