// SPDX-License-Identifier: Apache-2.0
// For builds without libwebp and libavif: the beginnings of such files, which are enough for them to reject these.
#include "compressed.h"

namespace vellum::test
{

Bytes webpImage(uint32_t, uint32_t, const Bytes &)
{
    return {'R', 'I', 'F', 'F', 22, 0, 0, 0, 'W', 'E', 'B', 'P', 'V', 'P', '8', 'L', 10, 0, 0, 0, 0x2f, 0, 0, 0, 0, 0};
}

Bytes avifImage(uint32_t, uint32_t, const std::vector<uint16_t> &, const AvifKind &)
{
    return {0, 0, 0, 20, 'f', 't', 'y', 'p', 'm', 'i', 'f', '1', 0, 0, 0, 0, 'a', 'v', 'i', 'f'};
}

} // namespace vellum::test
