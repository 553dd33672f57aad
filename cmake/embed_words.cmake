# SPDX-License-Identifier: Apache-2.0
# cmake -DIN=<file.spv> -DOUT=<file.h> -DSYMBOL=<name> -P embed_words.cmake
# Writes the SPIR-V words of IN as the header that glslang would write.
file(READ ${IN} hex HEX)
string(REGEX REPLACE "(..)(..)(..)(..)" "0x\\4\\3\\2\\1," words "${hex}")
string(REGEX REPLACE "((0x[0-9a-f]+,)(0x[0-9a-f]+,)?(0x[0-9a-f]+,)?(0x[0-9a-f]+,)?(0x[0-9a-f]+,)?(0x[0-9a-f]+,)?(0x[0-9a-f]+,)?)" "\\1\n" words "${words}")
file(WRITE ${OUT} "#pragma once\nconst uint32_t ${SYMBOL}[] = {\n${words}};\n")
