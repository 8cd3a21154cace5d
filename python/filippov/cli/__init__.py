"""The command line: ``filippov``, or ``python -m filippov``.

Exit codes: 0 all went well; 1 the run failed, and what it computed was written; 2 a mistake in the command or
in the model, said in one line; 130 Ctrl-C; 141 nobody reads what is printed any more (``| head``).
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence

from filippov.cli.mistakes import Mistake
from filippov.cli.parser import build_parser
from filippov.errors import FilippovError, FilippovWarning, Interrupted

__all__ = ["main"]

MISTAKE, INTERRUPTED, NOBODY_READS = 2, 130, 141


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows the name of the program; by default ``sys.argv[1:]``.

    Returns
    -------
    int

    Examples
    --------
    >>> from filippov.cli import main
    >>> main(["list", "biased"])
    biased_relay                  enters x = 0 at t = 1/0.7 and stays
    0
    """
    parser = build_parser()
    if "_ARGCOMPLETE" in os.environ:  # a shell asks what may follow
        from argcomplete import autocomplete

        autocomplete(parser)
    given = parser.parse_args(arguments)
    if given.run is None:
        parser.print_help()
        return 0
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FilippovWarning)  # the commands print them
            code: int = given.run(given)
        sys.stdout.flush()
    except (Mistake, FilippovError) as error:
        if given.debug:
            raise
        print(f"filippov: {error}", file=sys.stderr)
        return MISTAKE
    except ImportError as error:
        if given.debug or "pip install" not in str(error):
            raise
        print(f"filippov: {error}", file=sys.stderr)
        return MISTAKE
    except BrokenPipeError:
        # As a program that is ended by SIGPIPE. The interpreter shall not try to write the rest at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return NOBODY_READS
    except OSError as error:
        if given.debug:
            raise
        where = f"{error.filename}: " if error.filename else ""
        print(f"filippov: {where}{error.strerror or error}", file=sys.stderr)
        return MISTAKE
    except (Interrupted, KeyboardInterrupt) as error:
        print(f"filippov: interrupted. {error}".rstrip(), file=sys.stderr)
        return INTERRUPTED
    return code
