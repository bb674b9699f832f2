#!/bin/sh
# browser.sh PYTHON..: check that a Chromium exists: the program ARMLET_BROWSER, or one on PATH. Otherwise playwright downloads one.
set -eu
if [ -n "${ARMLET_BROWSER:-}" ]; then
    [ -x "$ARMLET_BROWSER" ] || { echo "armlet: ARMLET_BROWSER names no program: $ARMLET_BROWSER" >&2; exit 1; }
    exit 0
fi
for name in chromium chromium-browser google-chrome google-chrome-stable; do
    if command -v "$name" >/dev/null 2>&1; then exit 0; fi
done
"$@" -m playwright install chromium >/dev/null 2>&1 || {
    echo "armlet: no browser: install chromium (apt-get install chromium) or name one in ARMLET_BROWSER; playwright could not fetch its own" >&2
    exit 1
}
