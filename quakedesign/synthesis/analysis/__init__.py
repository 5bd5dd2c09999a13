"""Answers about given gains: verdict, how far they reach, where in the plane of two gains, how fast they settle."""
