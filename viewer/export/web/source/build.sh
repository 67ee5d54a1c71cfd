#!/usr/bin/env bash
# Builds viewer.js and licenses.txt of ../page, whose other files are written by hand, from this folder: needs node and npm, which nothing else here does.
set -euo pipefail
cd "$(dirname "$0")"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cp ./*.js package.json package-lock.json "$work"
(cd "$work" && npm ci --silent --no-audit --no-fund)
"$work/node_modules/.bin/esbuild" "$work/main.js" --bundle --minify --format=iife --target=es2020 --legal-comments=none \
    --outfile="$work/viewer.js" --log-level=warning \
    --banner:js="/* ntc-viewer (Apache-2.0) with three.js $(node -p "require('$work/node_modules/three/package.json').version") (MIT), see licenses.txt; sources $(cat ./*.js package.json package-lock.json | sha256sum | cut -c1-16) */"
cp "$work/viewer.js" ../page/
{
    echo "This page: ntc-viewer, Apache License 2.0, https://www.apache.org/licenses/LICENSE-2.0"
    echo
    echo "three.js:"
    echo
    cat "$work/node_modules/three/LICENSE"
} > ../page/licenses.txt
