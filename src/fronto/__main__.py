"""``python -m fronto`` is ``fronto``."""

from fronto.cli import main

if __name__ == "__main__":
    main(prog_name="fronto")
