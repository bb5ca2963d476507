#!/bin/sh
# Compiles the shaders of this folder anew; needs glslangValidator (Debian:
# glslang-tools). With -g the text goes into the binary.
set -eu
cd "$(dirname "$0")"
for stage in vert frag; do
    glslangValidator -V -g -o "convert.$stage.spv" "convert.$stage"
done
