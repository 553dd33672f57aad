// SPDX-License-Identifier: Apache-2.0
// Bakes the opacity micromap of a leaf on two triangles and prints what came out, in C++20.
//
//     cmake -S . -B build -DCMAKE_PREFIX_PATH=<prefix> && cmake --build build
//     c++ -std=c++20 bake.cpp -o bake $(pkg-config --cflags --libs vellum)
#include <algorithm>
#include <cstdlib>
#include <iostream>

#include <vellum/bake.h>

namespace
{

constexpr std::size_t kSize = 64;

// An ellipse with a soft border: texels of 8-bit RGBA.
std::vector<std::uint8_t> paintLeaf()
{
    std::vector<std::uint8_t> rgba;
    for (std::size_t y = 0; y < kSize; ++y)
        for (std::size_t x = 0; x < kSize; ++x) {
            const auto place = [](std::size_t i) { return (static_cast<double>(i) + 0.5) / kSize * 2 - 1; };
            const double dx = place(x);
            const double dy = place(y) / 0.6;
            const double alpha = std::clamp(0.5 + (0.8 - (dx * dx + dy * dy)) * 8, 0.0, 1.0);
            for (const double component : {0.2, 0.5, 0.1, alpha})
                rgba.push_back(static_cast<std::uint8_t>(component * 255 + 0.5));
        }
    return rgba;
}

} // namespace

int main()
try {
    // [bake]
    const std::vector<std::uint8_t> rgba = paintLeaf(); // kSize x kSize texels of 8-bit RGBA
    const vellum::Texture texture{
        .texels = std::as_bytes(std::span(rgba)),
        .width = kSize,
        .height = kSize,
        .addressModeU = vellum::AddressMode::ClampToEdge,
        .addressModeV = vellum::AddressMode::ClampToEdge,
        .offset = 3, // the alpha of RGBA
        .pixelStride = 4,
    };
    const std::array<float, 8> uvs = {0, 0, 1, 0, 0, 1, 1, 1};
    const std::array<std::uint16_t, 6> indices = {0, 1, 2, 3, 2, 1};
    const vellum::BakeInput card{
        .textures = {&texture, 1},
        .uvs = std::as_bytes(std::span(uvs)),
        .indices = std::as_bytes(std::span(indices)),
        .indexType = vellum::IndexType::Uint16,
        .cutoff = 0.5,
    };
    const vellum::Micromap micromap = vellum::bake(card, {.level = 5});
    // [bake end]
    std::cout << micromap.data().size() << " bytes of data for " << micromap.triangles().size() << " of "
              << micromap.indices().size() << " triangles\n"
              << "micro-triangles: " << micromap.stateCount(vellum::State::Transparent) << " transparent, "
              << micromap.stateCount(vellum::State::Opaque) << " opaque, "
              << micromap.stateCount(vellum::State::UnknownTransparent) +
                     micromap.stateCount(vellum::State::UnknownOpaque)
              << " unknown\n";
    for (const vellum::MicromapUsage &usage : micromap.usages())
        std::cout << usage.count << " of level " << usage.subdivisionLevel << ", format " << usage.format << "\n";

    // Less than half of that: where it hurts least, levels become lower.
    const vellum::Micromap smaller = vellum::bake(card, {.level = 5, .budget = micromap.data().size() / 2});
    std::cout << "with a budget: " << smaller.data().size() << " bytes, "
              << smaller.stateCount(vellum::State::UnknownTransparent) +
                     smaller.stateCount(vellum::State::UnknownOpaque)
              << " unknown\n";
    return EXIT_SUCCESS;
} catch (const std::exception &error) {
    std::cerr << error.what() << "\n";
    return EXIT_FAILURE;
}
