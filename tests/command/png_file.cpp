// SPDX-License-Identifier: Apache-2.0
#include "png_file.h"

#include <png.h>
#include <stdexcept>

namespace vellum::test
{

Png readPng(const std::filesystem::path &path)
{
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    if (png_image_begin_read_from_file(&image, path.c_str()) == 0)
        throw std::runtime_error(path.string() + ": " + image.message);
    Png result{image.width, image.height, {}};
    image.format = PNG_FORMAT_RGB;
    std::vector<uint8_t> bytes(PNG_IMAGE_SIZE(image));
    if (png_image_finish_read(&image, nullptr, bytes.data(), 0, nullptr) == 0)
        throw std::runtime_error(path.string() + ": " + image.message);
    for (size_t i = 0; i + 2 < bytes.size(); i += 3)
        result.pixels.push_back({bytes[i], bytes[i + 1], bytes[i + 2]});
    return result;
}

} // namespace vellum::test
