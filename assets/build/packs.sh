#!/usr/bin/env bash
# Encode the built-in scene in the two groupings that ship. The others are encoded on request (viewer/cli/encode.py).
set -euo pipefail
cd "$(dirname "$0")/.."
for grouping in baseline clustered; do
    ntc-viewer encode courtyard.glb --out "courtyard.$grouping.ntc" --grouping "$grouping" --codec block --bits 2.8
done
