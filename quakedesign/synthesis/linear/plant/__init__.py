"""The linear loop of a fault as exact matrices, and the bounds of its uncertainty."""
