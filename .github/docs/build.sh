#!/usr/bin/env bash
# Build the documentation strictly: SITE/online for a server, SITE/offline to open as files.
set -euo pipefail
cd "$(dirname "$0")/../.."
site=$(realpath -m "${1:-site}")
export NO_MKDOCS_2_WARNING=1
for kind in online offline; do
  OFFLINE=$([ "$kind" = offline ] && echo true || echo false) \
    python -m mkdocs build --strict --quiet -f .github/docs/mkdocs.yml -d "$site/$kind"
done
if grep -rlE '(src|href)="https?://[^"]*\.(js|css|woff2?)"' "$site/offline" --include='*.html'; then
  echo "these pages load something from elsewhere" >&2
  exit 1
fi
echo "$site/online and $site/offline written"
