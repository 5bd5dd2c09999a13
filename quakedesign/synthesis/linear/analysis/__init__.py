"""What is proved of a given K: stability over a box, margins, optimality, and their limits."""
