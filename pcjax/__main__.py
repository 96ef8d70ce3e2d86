"""`python -m pcjax`."""

from pcjax.cli import main

main()
