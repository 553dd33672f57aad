# cmake -DIN=<file.spv> -DOUT=<file.h> -DSYMBOL=<name> -P embed_words.cmake
# Writes the SPIR-V words of IN as a constexpr array.
file(READ ${IN} hex HEX)
string(REGEX REPLACE "(..)(..)(..)(..)" "0x\\4\\3\\2\\1u," words "${hex}")
string(REGEX REPLACE "((0x[0-9a-f]+u,)(0x[0-9a-f]+u,)?(0x[0-9a-f]+u,)?(0x[0-9a-f]+u,)?(0x[0-9a-f]+u,)?(0x[0-9a-f]+u,)?(0x[0-9a-f]+u,)?)" "\\1\n" words "${words}")
file(WRITE ${OUT} "#pragma once\n#include <cstdint>\ninline constexpr std::uint32_t ${SYMBOL}[] = {\n${words}};\n")
