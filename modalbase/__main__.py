"""`python -m modalbase`: the command, where the folder of scripts is not on the path."""

from importlib import import_module

# By name, for nothing of this package may need the service: the command itself does without it
# until it runs one.
import_module("service.app.cli").main()
