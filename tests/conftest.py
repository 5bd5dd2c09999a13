"""Random tests draw the same examples every time."""

from hypothesis import settings

settings.register_profile("reproducible", derandomize=True, print_blob=True)
settings.load_profile("reproducible")
