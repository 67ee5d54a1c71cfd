"""The process that owns a training: it needs no torch, and when it is killed the training goes too."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.training_workers import blocks, lives

pytestmark = pytest.mark.process


def test_the_handle_needs_no_torch() -> None:
    code = "import sys, ntc.worker.client; sys.exit(int('torch' in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.skipif(sys.platform == "win32", reason="kills by signal")
@pytest.mark.parametrize("closed", [True, False])
def test_nothing_is_left_of_a_program_that_ends_or_is_killed(tmp_path: Path, closed: bool) -> None:
    script = tmp_path / "owner.py"
    script.write_text(
        f"""
import sys, time
import numpy as np
from ntc.codec.grid.model import GridConfig
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.codec.grid.training.config import TrainingConfig
from ntc.worker.client import TrainingWorker
from ntc.training.messages import TrainingProgress
from ntc.training.messages import TrainingRequest

def main():
    texture = SourceTexture("t", np.zeros((16, 16, 3), np.uint8) + np.arange(16, dtype=np.uint8)[:, None], "0")
    training = TrainingConfig(steps=10**7, texels_per_texture=64, device="cpu", converged_db=None)
    worker = TrainingWorker()
    worker.start(TrainingRequest((texture,), Grouping("single", (0,)), GridConfig(hidden_width=16), training))
    while not any(isinstance(report, TrainingProgress) for report in worker.poll()):
        time.sleep(0.01)
    print(worker.process_id, flush=True)
    while not {closed}:
        time.sleep(0.01)
    # Ends without closing.

if __name__ == "__main__":
    main()
"""
    )
    owner = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert owner.stdout is not None
    process = int(owner.stdout.readline())
    if not closed:
        owner.kill()
    _, errors = owner.communicate(timeout=30)
    assert errors == "", "no tracebacks, and no warnings of what leaked"
    end = time.monotonic() + 5.0
    while lives(process) and time.monotonic() < end:
        time.sleep(0.02)
    assert not lives(process)
    assert blocks(owner.pid) == []
    assert owner.returncode == (0 if closed else -9)
