"""A given K with its pressure held over the sampling time."""
