#!/bin/sh
# Make the project's Python environment: setup/venv.sh FOLDER PYTHON
set -eu
"$2" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    { echo "setup: $2 is older than Python 3.11; set PYTHON=..." >&2; exit 1; }
rm -rf "$1"
if ! "$2" -m venv "$1" >/dev/null 2>&1; then
    rm -rf "$1"
    echo "setup: $2 can't make a virtual environment (package python3-venv)" >&2
    exit 1
fi
