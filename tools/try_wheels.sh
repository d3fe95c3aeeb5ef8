#!/bin/sh
# Builds wheels and sources of all packages and flies with each in an empty environment:
#   sh tools/try_wheels.sh python3.11 python3.12 python3.13
# Without extras: import and a first flight. With the extra `all`: the help of a scan and a picture-free report too.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
build=$root/.venv/bin/uv
for package in . packages/wakewise-ardusub packages/wakewise-paper packages/wakewise-nerf; do
    "$build" build --quiet --out-dir "$work/dist" "$root/$package"
done
ls "$work/dist"
cd "$work" # not beside the sources
for python in "$@"; do
    for extra in "" "[all]"; do
        rm -rf env
        "$python" -m venv env
        wheel=$(ls dist/wakewise-*.whl)
        env/bin/pip install --quiet --disable-pip-version-check "$wheel$extra"
        env/bin/python -c "
import sys, wakewise as ww
flight = ww.fly(ww.Scenario.preset('quick', world='quasi-steady', method='wake-aware'), duration_s=2.0)
print(sys.version.split()[0], '$extra' or 'core', flight)"
        env/bin/wakewise vehicle show bluerov2-heavy --quiet >/dev/null
        env/bin/wakewise scan --help >/dev/null
    done
    env/bin/pip install --quiet --disable-pip-version-check dist/wakewise_ardusub-*.whl dist/wakewise_paper-*.whl
    env/bin/wakewise link --help >/dev/null
    env/bin/wakewise reproduce --help >/dev/null
    # The sources make the same package.
    rm -rf env && "$python" -m venv env
    env/bin/pip install --quiet --disable-pip-version-check dist/wakewise-*.tar.gz
    env/bin/wakewise --version
done
