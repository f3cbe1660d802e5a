#!/bin/sh
# Compiles ahead, into the installation itself, the kernels that a score needs; after that nobody may write to it.
#
#   sh warm.sh PREFIX PROTOCOL CONTROLLER...
#
# Each controller is scored once on one arm, and the score is thrown away: so nothing that a score needs is left out.
# By one process: of two that keep variants of one kernel at the same moment, one may be lost. With a home and a temporary
# folder of its own: a kernel that lies there already would be read, and not put into the installation.
# All arms of the protocol have seven joints, for which the kernels are the same.
set -eu
prefix=$1
protocol=$2
shift 2
folder=$(mktemp -d)
for controller in "$@"; do
  HOME="$folder" TMPDIR="$folder" "$prefix/bin/surgsim" score "$controller" --protocol "$protocol" --arms panda --jobs 1 \
    --store "$folder/store" --out "$folder/$(basename "$controller")" > /dev/null
done
rm -rf "$folder"
chmod -R a+rX,a-w "$prefix"
