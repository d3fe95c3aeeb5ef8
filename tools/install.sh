#!/bin/sh
# Installs what a lock file pins: install.sh PYTHON LOCK. uv, itself pinned there, does in 7 s what takes pip 31, since it
# fetches and unpacks side by side. Where it cannot be had or cannot install, pip does it. Nothing is compiled to
# bytecode: a third of pip's time, most of it for modules that nobody imports.
set -eu
python=$1 lock=$2
alone=$(mktemp)
trap 'rm -f "$alone"' EXIT
sed -n '/^uv==/,/[^\\]$/p' "$lock" >"$alone"
by_pip() { "$python" -m pip install --no-compile --quiet --disable-pip-version-check --require-hashes -r "$1"; }
# A mirror that pip was told of; uv asks pip for none of its settings.
index=$("$python" -m pip config get global.index-url 2>/dev/null) || index=
index=${UV_DEFAULT_INDEX:-${PIP_INDEX_URL:-$index}}
if [ -n "$index" ]; then export UV_DEFAULT_INDEX="$index"; fi
# A lock without uv is one of what is installed on top of what has it.
if { [ ! -s "$alone" ] || by_pip "$alone" 2>/dev/null; } &&
    "$(dirname "$python")/uv" pip install --python "$python" --quiet --require-hashes -r "$lock"; then exit 0; fi
echo "uv cannot install here: pip does, which takes half a minute longer"
by_pip "$lock"
