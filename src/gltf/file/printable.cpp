// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/printable.h"

namespace vellum
{

std::string printable(std::string text)
{
    std::string clean;
    clean.reserve(text.size());
    for (size_t i = 0; i < text.size(); ++i) {
        const auto byte = static_cast<unsigned char>(text[i]);
        const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
        const bool longControl = byte == 0xc2 && next >= 0x80 && next < 0xa0;
        clean += byte < 0x20 || byte == 0x7f || longControl ? '?' : text[i];
        i += longControl ? 1 : 0;
    }
    return clean;
}

} // namespace vellum
