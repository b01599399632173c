"""`python -m service`: the command `modalbase`, for processes that the service starts itself."""

from service.app.cli import main

main()
