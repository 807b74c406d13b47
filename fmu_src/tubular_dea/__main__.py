"""`python -m tubular_dea`: the command line."""

import sys

from .cli import main

sys.exit(main())
