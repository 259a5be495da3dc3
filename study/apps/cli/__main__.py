"""`python -m study.apps.cli`."""

from study.apps.cli import main

main()
