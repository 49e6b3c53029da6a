"""The verbs of the command line, a file for each kind; sil/cli.py puts them together."""
