"""`python -m modalbase`: the command, where the folder of scripts is not on the path."""

from service.cli import main

main()
