#!/bin/sh
# Keeps the files that an installation adds to a folder: added.sh FOLDER TARGET COMMAND...
# What is copied is what the next layer of an image needs beside the one before.
set -eu
folder=$1 target=$2
shift 2
before=$(mktemp)
find "$folder" -type f -o -type l | sort > "$before"
"$@"
"$(dirname "$0")/slim.sh" "$folder"
mkdir -p "$target"
find "$folder" -type f -o -type l | sort | comm -13 "$before" - | tar -cf - --files-from=- | tar -xf - -C "$target"
rm "$before"
