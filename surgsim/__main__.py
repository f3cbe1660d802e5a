"""`python -m surgsim`."""

import sys

from surgsim.cli.main import main

sys.exit(main())
