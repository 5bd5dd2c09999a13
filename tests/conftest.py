"""Random tests draw the same examples every time; every worker computes on one thread, as there is one per core."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from hypothesis import settings

settings.register_profile("reproducible", derandomize=True, print_blob=True)
settings.load_profile("reproducible")
