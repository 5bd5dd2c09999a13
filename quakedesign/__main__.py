"""``python -m quakedesign``, and the command ``quakedesign``."""

from quakedesign.interruption import ending


def main() -> None:
    """Run the command line; an interruption is one line from the first import on."""
    with ending(process=True):
        from quakedesign.cli import main as run

        run()


if __name__ == "__main__":
    main()
