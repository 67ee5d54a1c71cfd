#!/usr/bin/env bash
# Builds three.js and LICENSE of this folder from npm's package: what names.js names of it, minified. Needs node and npm.
set -euo pipefail
cd "$(dirname "$0")"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cp names.js package.json package-lock.json "$work"
(cd "$work" && npm ci --silent --no-audit --no-fund)
"$work/node_modules/.bin/esbuild" "$work/names.js" --bundle --minify --format=esm --target=es2022 --legal-comments=none \
    --outfile="$work/three.js" --log-level=warning \
    --banner:js="/* three.js $(node -p "require('$work/node_modules/three/package.json').version"), MIT License, see LICENSE; built by build.sh from $(cat build.sh names.js package.json package-lock.json | sha256sum | cut -c1-16) */"
cp "$work/three.js" "$work/node_modules/three/LICENSE" .
