"""`python -m service`: the command `modalbase`, for processes that the service starts itself."""

from service.cli import main

main()
