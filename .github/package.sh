#!/usr/bin/env bash
# Build wheel and source into a folder, check them, install each elsewhere, and try it there.
# usage: package.sh DIST [VERSION]   VERSION: that they must have
set -euo pipefail
cd "$(dirname "$0")/.."
dist=$(realpath -m "${1:-dist}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

python -m venv "$work/tools"
"$work/tools/bin/pip" install --quiet build twine check-wheel-contents
"$work/tools/bin/python" -m build --outdir "$dist" .
"$work/tools/bin/twine" check --strict "$dist"/*
"$work/tools/bin/check-wheel-contents" --ignore W002 "$dist"/*.whl

cd "$work"  # away from the clone
for package in "$dist"/*.whl "$dist"/*.tar.gz; do
  rm -rf try out mine
  python -m venv try
  try/bin/pip install --quiet "$package"
  try/bin/sdt-drake --version | grep -F "${2:-sdt-drake}"
  try/bin/sdt-drake reproduce --out out >out.txt
  try/bin/sdt-drake init mine >>out.txt
  try/bin/sdt-drake simulate mine/scenario.yaml >>out.txt
  test -s out/report.html
done
echo "$(ls "$dist") built and tried"
