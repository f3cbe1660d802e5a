#!/bin/sh
# Installs surgsim, the small installation, from a checkout into a prefix of its own: what the image's build does, step by step.
#
#   sh install.sh SOURCE PREFIX [OPTIONS OF PIP]
#
# Everything under PREFIX belongs to whoever runs this, and everybody may read and run it.
set -eu
source=$1
prefix=$2
shift 2
python3 -m venv "$prefix"
"$prefix/bin/python" -m pip install --no-cache-dir --disable-pip-version-check -c "$source/constraints.txt" "$@" "$source/core"
