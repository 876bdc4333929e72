"""`python -m glider.hal.outofband`: see guard.py."""

import sys

from glider.hal.outofband.guard import main

sys.exit(main())
