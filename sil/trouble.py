"""What can go wrong with a run, as exceptions that carry one clear line and the exit code of DESIGN's table."""

from __future__ import annotations

EXIT_OK = 0
EXIT_REQUIREMENT = 1
EXIT_USAGE = 2
EXIT_LINK = 3
EXIT_INTERRUPTED = 130


class SilError(Exception):
    """One line for a person: `where: expected X, got Y; known: a, b, c`."""

    exit_code = EXIT_USAGE


class UsageError(SilError):
    """The command line, the scenario or a file is not what it should be."""


class LinkFailure(SilError):
    """Link or board: silent, gone, of another version, or it refuses the configuration."""

    exit_code = EXIT_LINK
