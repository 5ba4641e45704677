#!/bin/sh
# ilfstage: finds its Python, its parts and the renderers of the tree that it stands in, which may have been moved.
# ILF_PYTHON names another Python (3.11 or later, with numpy, scipy and cffi; matplotlib for pictures).
bin=$(dirname "$(readlink -f "$0")")
if [ -d "$bin/../share/ilf/programs/ilfstage" ]; then
    parts=$bin/../share/ilf/programs python=python3 path=$bin/../lib/ilf/bin:$bin
else
    parts=$bin/../../tools:$bin/../../python/src python=$bin/../venv/bin/python path=$bin
fi
python=${ILF_PYTHON:-$python}
command -v "$python" >/dev/null || { echo "ilfstage: expected Python at $python, found none (make build/venv/.packages, or ILF_PYTHON=...)" >&2; exit 1; }
PYTHONPATH=$parts${PYTHONPATH:+:$PYTHONPATH} PATH=$path:$PATH PYTHONDONTWRITEBYTECODE=1 ILFSTAGE_VERSION=@VERSION@ exec "$python" -P -m ilfstage "$@"
