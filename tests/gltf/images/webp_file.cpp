// SPDX-License-Identifier: Apache-2.0
#include <webp/encode.h>

#include "compressed.h"

namespace vellum::test
{

Bytes webpImage(uint32_t width, uint32_t height, const Bytes &rgba)
{
    uint8_t *encoded = nullptr;
    const size_t size = WebPEncodeLosslessRGBA(rgba.data(), static_cast<int>(width), static_cast<int>(height),
                                               static_cast<int>(4 * width), &encoded);
    const Bytes bytes(encoded, encoded + size);
    WebPFree(encoded);
    return bytes;
}

} // namespace vellum::test
