#!/bin/sh
# A headless browser for the tests of the cockpit's page, from Debian's packages. Where it cannot be had, those tests
# say that they were skipped and why.
set -eu
if command -v chromium >/dev/null; then exit 0; fi
if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
    log=$(mktemp)
    { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
        chromium fonts-liberation; } >"$log" 2>&1 || tail -n 3 "$log"
    rm -f "$log"
fi
command -v chromium >/dev/null || echo "no chromium: the tests of the page in a browser will be skipped"
