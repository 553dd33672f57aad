// SPDX-License-Identifier: Apache-2.0
// Fuzz target of micromap inputs. The first byte says which part an input is for.
#include "micromap_fuzz.h"

#include "reader.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    vellum::fuzz::Reader input({data, size});
    switch (input.byte() % 4) {
    case 0:
    case 1: vellum::fuzz::buildMemory(input); break;
    case 2: vellum::fuzz::hostCommands(input); break;
    default: vellum::fuzz::model(input); break;
    }
    return 0;
}
