#!/bin/sh
# ilfstage: finds its Python, its parts and the renderers of the tree that it stands in, which may have been moved.
# ILF_PYTHON names another Python (3.11 or later, with numpy, scipy and cffi; matplotlib for pictures).
bin=$(dirname "$(readlink -f "$0")")
parts=$bin/../../tools:$bin/../../python/src python=$bin/../venv/bin/python path=$bin
for share in "$bin/../share" "$bin/../../../share"; do # installed, in bin or lib/ilf/bin
    [ ! -d "$share/ilf/programs/ilfstage" ] || parts=$share/ilf/programs python=python3 path=$bin/../lib/ilf/bin:$bin
done
python=${ILF_PYTHON:-$python}
command -v "$python" >/dev/null || { echo "ilfstage: expected Python at $python, found none (make build/venv/.packages, or ILF_PYTHON=...)" >&2; exit 1; }
PYTHONPATH=$parts${PYTHONPATH:+:$PYTHONPATH} PATH=$path:$PATH PYTHONDONTWRITEBYTECODE=1 ILFSTAGE_VERSION=@VERSION@ ILFSTAGE_CALLED=${0##*/} exec "$python" -P -m ilfstage "$@"
