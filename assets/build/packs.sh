#!/usr/bin/env bash
# Encode the built-in scene once for each grouping.
set -euo pipefail
cd "$(dirname "$0")/.."
encode() {
    ntc-viewer encode courtyard.glb --out "courtyard.$1.ntc" --grouping "$@" --codec block --bits 2.2
}
encode baseline
encode single
encode category
encode clustered --clusters 10
encode random --clusters 10
encode covisible --clusters 10 --views courtyard.cameras.json
