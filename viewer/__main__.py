"""`python -m viewer` is `ntc-viewer`."""

import sys

from viewer.cli import main

sys.exit(main())
