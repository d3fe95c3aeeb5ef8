#!/bin/sh
# Builds wheels and sources of all packages and tries them in empty environments, one for each Python that is given:
#   sh tools/try_wheels.sh python3.11 python3.12 python3.13
# First without extras: a first flight. Then with the extra `all` and the other packages: a scan's help, a photograph, the
# commands of the packages. Last from the sources. A first flight compiles kernels, a minute or two for each Python.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for package in . packages/wakewise-ardusub packages/wakewise-paper packages/wakewise-nerf benchmarks; do
    "$root/.venv/bin/uv" build --quiet --out-dir "$work/dist" "$root/$package"
done
cd "$work" # not beside the sources
ls dist
install() { "env/bin/pip" install --quiet --disable-pip-version-check "$@" 2>&1 | grep -v '^WARNING' || true; }
for python in "$@"; do
    rm -rf env
    "$python" -m venv env
    wheel=$(ls dist/wakewise-*.whl)
    install "$wheel"
    env/bin/python -c "
import sys, wakewise as ww
print(sys.version.split()[0], 'core:', ww.fly(ww.Scenario.preset('quick'), duration_s=2.0))"
    env/bin/wakewise vehicle show bluerov2-heavy --quiet >/dev/null
    # Without its extra, wakewise-nerf brings no PyTorch, which is gigabytes: it is imported and shows its help.
    install "$wheel[all]" dist/wakewise_*.whl
    env/bin/python -c "import wakewise_nerf.field, wakewise_benchmarks"
    env/bin/wakewise target show brain --out brain.svg --quiet >/dev/null
    for command in scan reconstruct link reproduce nerf bench; do env/bin/wakewise $command --help >/dev/null; done
    echo "extras and packages: commands run"
    rm -rf env
    "$python" -m venv env
    install dist/wakewise-*.tar.gz
    echo "sources: $(env/bin/wakewise --version)"
done
