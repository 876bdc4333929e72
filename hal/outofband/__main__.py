"""`python -m hal.outofband`: see guard.py."""

import sys

from hal.outofband.guard import main

sys.exit(main())
