"""Compiling an encoder in a thread, before its first encoding on a machine."""

import threading
import time
from collections.abc import Sized
from contextlib import suppress
from typing import Self

from ntc.codec.codec import Codec
from ntc.codec.encoding import Interruption
from ntc.training.messages import ProgressListener, TrainingProgress

COMPILING = "compiling the encoder, once"
"""Phase that progress reports while loops are compiled."""
SECONDS_BETWEEN_REPORTS = 0.1


class CompilingAhead:
    """Loads the compiled loops of a codec in a thread, or compiles those that no earlier process has compiled.

    Leaving the `with` block ends the thread after the current loop.
    """

    def __init__(self, codec: Codec) -> None:
        self._codec, self._stopped = codec, threading.Event()
        self._compiled: Sized = ()
        self._thread = threading.Thread(target=self._run, name="compile")
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exception: object) -> None:
        self._stopped.set()
        self._thread.join()

    @property
    def is_compiling(self) -> bool:
        """True while loops are compiled. False while they are only loaded, which takes less than a second."""
        return len(self._compiled) > 0 and self._thread.is_alive()

    def wait_loaded(self) -> bool:
        """Wait until all loops are loaded. Return False as soon as one must be compiled."""
        while self._thread.is_alive() and not self.is_compiling:
            self._thread.join(SECONDS_BETWEEN_REPORTS)
        return not self._thread.is_alive()

    def wait(self, progress: ProgressListener, interruption: Interruption) -> None:
        """Wait until all loops are loaded or compiled.

        `progress` gets reports without steps while loops are compiled. `interruption` is called often; what it raises ends the wait.
        """
        began = time.monotonic()
        while self._thread.is_alive():
            interruption()
            if self.is_compiling:
                elapsed = max(time.monotonic() - began, 1e-6)
                progress(TrainingProgress(0.0, 0.0, 0, 0, 0, {}, {}, COMPILING, elapsed_seconds=elapsed))
            self._thread.join(SECONDS_BETWEEN_REPORTS)

    def _run(self) -> None:
        # The encoding will raise and report the same error.
        with suppress(Exception):
            functions = self._codec.compiled_functions()
            if not functions:
                return
            from numba.core import event

            # numba records a function that it compiles, but not one that it loads.
            with event.install_recorder("numba:compile") as recorder:
                self._compiled = recorder.buffer
                for function, types in functions.items():
                    if self._stopped.is_set():
                        return
                    function.compile(types)
