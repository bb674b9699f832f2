"""Entry point of `python -m armlet`, the command line."""

import sys

from .cli import main

sys.exit(main())
