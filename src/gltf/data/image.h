// PNG and JPEG decoding.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace vellum
{

struct Image {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::vector<std::uint8_t> rgba; // 4 * width * height bytes, as stored (colour is sRGB)
};

// Decodes to RGBA. Throws GltfError, its message beginning with `what`, for anything but a whole PNG or JPEG of at most
// 16,384 texels in each direction.
Image decodeImage(std::span<const std::uint8_t> encoded, const std::string &what);

} // namespace vellum
