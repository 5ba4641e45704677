#!/bin/sh
# ilfstage: finds its Python, its parts and the renderers of the tree that it stands in, which may have been moved.
# ILF_PYTHON names another Python (3.11 or later, with numpy, scipy and cffi; matplotlib for pictures).
bin=$(dirname "$(readlink -f "$0")")
if [ -d "$bin/../share/ilf/programs/ilfstage" ]; then
    parts=$bin/../share/ilf/programs:$bin/../share/ilf/python/src
    python=python3 path=$bin/../lib/ilf/bin:$bin
    [ -n "${ILF_LIBRARY-}" ] || [ ! -f "$bin/../lib/libilf.so.0" ] || export ILF_LIBRARY="$bin/../lib/libilf.so.0"
else
    parts=$bin/../../tools:$bin/../../python/src
    python=$bin/../venv/bin/python path=$bin
fi
PYTHONPATH=$parts${PYTHONPATH:+:$PYTHONPATH} PATH=$path:$PATH PYTHONDONTWRITEBYTECODE=1 ILFSTAGE_VERSION=@VERSION@ exec "${ILF_PYTHON:-$python}" -P -m ilfstage "$@"
