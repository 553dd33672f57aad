// SPDX-License-Identifier: Apache-2.0
#include "cli/picture/palette.h"

#include <algorithm>
#include <span>

namespace vellum::cli
{
namespace
{

constexpr size_t kMostColors = 256;

uint32_t channelOf(uint32_t pixel, unsigned channel)
{
    return (pixel >> (8 * channel)) & 255;
}

// Pixels that get one colour.
struct Box {
    std::span<uint32_t> pixels; // indices into the picture
    unsigned widest = 0;        // the channel that varies most
    double error = 0;           // its squared differences from the mean, in sum
};

Box makeBox(const Picture &picture, std::span<uint32_t> pixels)
{
    Box box{pixels, 0, 0};
    for (unsigned channel = 0; channel < 3; ++channel) {
        double sum = 0;
        double squares = 0;
        for (const uint32_t pixel : pixels) {
            const double value = channelOf(picture.pixels[pixel], channel);
            sum += value;
            squares += value * value;
        }
        const double error = squares - sum * sum / static_cast<double>(pixels.size());
        if (error > box.error)
            box = {pixels, channel, error};
    }
    return box;
}

uint32_t meanOf(const Picture &picture, const Box &box)
{
    uint32_t color = 0xff000000u;
    for (unsigned channel = 0; channel < 3; ++channel) {
        uint64_t sum = 0;
        for (const uint32_t pixel : box.pixels)
            sum += channelOf(picture.pixels[pixel], channel);
        color |= static_cast<uint32_t>((sum + box.pixels.size() / 2) / box.pixels.size()) << (8 * channel);
    }
    return color;
}

// The pixels above the mean of the box's widest channel, of which there are some and not all, move to a box of their
// own.
void split(const Picture &picture, std::vector<Box> &boxes, size_t which)
{
    const Box box = boxes[which];
    uint64_t sum = 0;
    for (const uint32_t pixel : box.pixels)
        sum += channelOf(picture.pixels[pixel], box.widest);
    const uint64_t mean = sum / box.pixels.size();
    const auto above = std::partition(box.pixels.begin(), box.pixels.end(), [&](uint32_t pixel) {
        return channelOf(picture.pixels[pixel], box.widest) <= mean;
    });
    const auto count = static_cast<size_t>(above - box.pixels.begin());
    boxes[which] = makeBox(picture, box.pixels.first(count));
    boxes.push_back(makeBox(picture, box.pixels.subspan(count)));
}

} // namespace

Palette makePalette(const Picture &picture)
{
    std::vector<uint32_t> order(picture.pixels.size());
    for (size_t i = 0; i < order.size(); ++i)
        order[i] = static_cast<uint32_t>(i);
    std::vector<Box> boxes = {makeBox(picture, order)};
    while (boxes.size() < kMostColors) {
        const auto worst =
            std::max_element(boxes.begin(), boxes.end(), [](const Box &a, const Box &b) { return a.error < b.error; });
        if (worst->error < 0.25) // two pixels that differ by 1 make 0.5
            break;
        split(picture, boxes, static_cast<size_t>(worst - boxes.begin()));
    }
    Palette palette;
    palette.indices.resize(picture.pixels.size());
    for (const Box &box : boxes) {
        for (const uint32_t pixel : box.pixels)
            palette.indices[pixel] = static_cast<uint8_t>(palette.colors.size());
        palette.colors.push_back(meanOf(picture, box));
    }
    return palette;
}

} // namespace vellum::cli
