#!/usr/bin/env bash
# Encode the built-in scene once for each grouping.
set -euo pipefail
cd "$(dirname "$0")/.."
for grouping in clustered baseline single random; do
    ntc-viewer encode courtyard.glb --out "courtyard.$grouping.ntc" --grouping "$grouping" --clusters 10 --steps "${1:-2500}"
done
