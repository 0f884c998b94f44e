"""Runs the command line: `python -m inverse`."""

import sys

from inverse.cli import main

if __name__ == "__main__":
    sys.exit(main())
