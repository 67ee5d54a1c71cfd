"""Jobs on a cluster: tasks of Ray, which is an extra of its own."""

import importlib
from collections.abc import Callable
from typing import Any, Generic

from ntc.errors import InputError
from viewer.jobs.executor import ONE_THREAD, Ended
from viewer.jobs.function_process import Argument
from viewer.jobs.job import Result

CPU, GPU = "CPU", "GPU"


def _ray() -> Any:
    try:
        return importlib.import_module("ray")
    except ImportError as error:
        raise InputError("--ray: needs the extra `ray`: pip install 'ntc-viewer[ray]'") from error


class RayExecutor(Generic[Argument, Result]):
    """Tasks of a Ray cluster, each on one core, and a share of a GPU where that is asked for.

    Ray itself does not begin tasks again: whoever runs the jobs counts attempts, whichever executor they run in.
    """

    def __init__(self, function: Callable[[Argument], Result], address: str, gpus: float = 0.0) -> None:
        """`address` of the cluster, or `auto` for the one that runs on this machine. `gpus` for each job, also less than one.

        Raises InputError without Ray, where no cluster answers, and where it has no such GPU.
        """
        self._ray = _ray()
        try:
            self._ray.init(address=address, log_to_driver=False, configure_logging=False, logging_level="error")
        except (ConnectionError, RuntimeError, ValueError, OSError) as error:
            raise InputError(
                f"--ray {address}: no cluster answers ({error}); begin one by: ray start --head"
            ) from error
        self._gpus = gpus
        options = {"num_cpus": 1, "num_gpus": gpus, "max_retries": 0, "scheduling_strategy": "SPREAD"}
        self._task = self._ray.remote(function).options(**options, runtime_env={"env_vars": ONE_THREAD})
        self._waiting: dict[Any, int] = {}
        if gpus > 0.0 and self._ray.cluster_resources().get(GPU, 0.0) < min(gpus, 1.0):
            self.close()
            raise InputError(f"--gpus-per-job {gpus:g}: the cluster at {address} has no GPU; leave it out")

    @property
    def slots(self) -> int:
        """Jobs that the cluster has room for at this moment."""
        resources = self._ray.cluster_resources()
        most = resources.get(CPU, 1.0)
        return max(1, int(min(most, resources.get(GPU, 0.0) / self._gpus) if self._gpus > 0.0 else most))

    def submit(self, number: int, argument: Argument, attempt: int) -> None:
        """Begin a job; Ray spreads tasks over its machines."""
        del attempt
        self._waiting[self._task.remote(argument)] = number

    def wait(self, seconds: float) -> list[Ended[Result]]:
        """The jobs that have ended."""
        done, _ = self._ray.wait(list(self._waiting), num_returns=1, timeout=seconds)
        return [self._ended(reference) for reference in done]

    def _ended(self, reference: Any) -> Ended[Result]:
        number = self._waiting.pop(reference)
        try:
            return Ended(number, self._ray.get(reference))
        except self._ray.exceptions.RayTaskError as error:
            cause = error.cause
            text = str(cause) if isinstance(cause, InputError) else f"{type(cause).__name__}: {cause}"
            return Ended(number, None, text)
        except self._ray.exceptions.RayError as error:
            return Ended(
                number, None, f"worker: gave no answer ({type(error).__name__}); its process or machine is gone"
            )

    def close(self) -> None:
        """Cancel what is under way, and leave the cluster."""
        for reference in self._waiting:
            self._ray.cancel(reference, force=True)
        self._waiting.clear()
        self._ray.shutdown()
