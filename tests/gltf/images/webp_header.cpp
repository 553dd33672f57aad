// SPDX-License-Identifier: Apache-2.0
// For builds without libwebp: the beginning of such a file, which is enough for them to reject it.
#include "compressed.h"

namespace vellum::test
{

Bytes webpImage(uint32_t, uint32_t, const Bytes &)
{
    return {'R', 'I', 'F', 'F', 22, 0, 0, 0, 'W', 'E', 'B', 'P', 'V', 'P', '8', 'L', 10, 0, 0, 0, 0x2f, 0, 0, 0, 0, 0};
}

} // namespace vellum::test
