"""Training and drawing in one process, beside a stand-in for triton that ends the process, as triton's LLVM does beside Mesa's."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.gl, pytest.mark.process, pytest.mark.slow, pytest.mark.once]

SCRIPT = """
import sys
from dataclasses import replace

import numpy as np
import torch

from ntc import api
from ntc.codec.grid.training.config import recipe_config
from viewer.gl.context import create_headless_context

context = create_headless_context()
noise = np.random.default_rng(0).integers(0, 256, (16, 16, 3), np.uint8)
for recipe in ("paper", "best"):
    api.encode([api.texture(noise)], codec="grid", training=replace(recipe_config(recipe), steps=3, epochs=None))
compiler = [name for name in sys.modules if name.partition(".")[0] == "triton" or name.startswith("torch._dynamo")]
print("loaded by training:", compiler)
try:
    import triton
except ImportError as error:
    print("refused:", error)
# Optimisers of torch ask for triton, and work without it.
parameter = torch.nn.Parameter(torch.zeros(1))
optimizer = torch.optim.Adam([parameter], lr=0.5)
(parameter - 1.0).square().sum().backward()
optimizer.step()
print("moved to:", round(float(parameter.detach()), 3))
"""


def test_neither_training_nor_torch_loads_triton_beside_a_context(tmp_path: Path) -> None:
    package = tmp_path / "packages" / "triton"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("import os\nos._exit(139)\n", encoding="utf-8")
    # No `__main__` guard: a script needs none.
    script = tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    path = os.pathsep.join([str(package.parent), str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
    ran = subprocess.run(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    loaded, refused, moved = ran.stdout.splitlines()
    assert loaded == "loaded by training: []"
    assert refused.startswith("refused: triton is not loaded: this process has an OpenGL context")
    assert moved == "moved to: 0.5"
