"""Entry point of `ntc-viewer`: parse, dispatch, and turn bad input into one line and exit status 2."""

import importlib
import sys
from collections.abc import Sequence

from ntc.errors import InputError
from ntc.threads import wait_passively
from viewer.cli.arguments import parse_arguments
from viewer.gl.context_loss import ContextLostError
from viewer.gl.systems import SYSTEM

BAD_INPUT = 2
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `ntc-viewer` with `arguments` (None: those of the process) and return its exit status."""
    wait_passively()
    try:
        command, options = parse_arguments(sys.argv[1:] if arguments is None else arguments)
        status: int = getattr(importlib.import_module(command.module), command.function)(options)
        return status
    except InputError as error:
        sys.stderr.write(f"error: {error}\n")
        return BAD_INPUT
    except ContextLostError as lost:
        sys.stderr.write(
            f"error: {lost}; what was not finished has not been written; run it again, "
            f"or without the GPU: {SYSTEM.software}\n"
        )
        return BAD_INPUT
    except BrokenPipeError:
        # The reader of a pipe (`| head`) has closed it: nobody reads further output.
        sys.stderr.close()
        return 0
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
