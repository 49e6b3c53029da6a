"""THE BOARD: what would fly, in Python. Imports `protocol` (the cable) and nothing of the laboratory."""
