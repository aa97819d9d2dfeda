"""``python -m inercal``."""

from inercal.cli import main

main()
