"""A guard against triton in processes that draw: Mesa's LLVM and triton's end a process that loads both, Mesa's first."""

import sys
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType

REFUSED = "triton"
REASON = (
    "triton is not loaded: this process has an OpenGL context, and the LLVM inside triton crashes beside Mesa's; "
    "use triton and torch.compile in another process, or import triton before the first context is made"
)


class _Refusal(Loader):
    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        raise ImportError(REASON, name=spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Never reached: no module is made."""


class _Guard(MetaPathFinder):
    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        # A triton that is not installed stays "not found". torch takes either for "no triton", and works without it.
        if fullname == REFUSED and PathFinder.find_spec(fullname, path) is not None:
            return ModuleSpec(fullname, _Refusal())
        return None


def refuse_triton() -> None:
    """Make a later `import triton` in this process an ImportError that says why; call it before a context is made.

    A triton that is loaded already stays: in that order both work. torch's optimisers and torch.compile import triton.
    """
    if not any(isinstance(finder, _Guard) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Guard())
