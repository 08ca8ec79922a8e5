#!/bin/sh
# Takes out of an installation what no program here imports: slim.sh FOLDER
# Symbols for debuggers, headers, stubs, other packages' tests, PyBullet's examples. Libraries that
# wheels have patched (NumPy's, OpenCV's) are left as they are.
set -eu
packages=$(find "$1" -type d -name site-packages)
find "$packages" -name '*.so' -not -path '*.libs/*' -not -path '*/numpy/*' -not -path '*/cv2/*' \
    -exec strip --strip-unneeded {} +
find "$packages" -name '*.pyi' -delete
find "$packages/numpy" -type d \( -name tests -o -name include \) -prune -exec rm -r {} +
rm -rf "$packages"/numpy/f2py "$packages"/numpy/distutils \
    "$packages"/pybullet_data "$packages"/pybullet_envs "$packages"/pybullet_examples \
    "$packages"/pybullet_robots "$packages"/pybullet_utils "$packages"/eglRenderer*.so
