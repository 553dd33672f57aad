// SPDX-License-Identifier: Apache-2.0
// Pictures of states over the texture, in UV space.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "bake/bake.h"
#include "base/picture.h"
#include "inspect/inspected_file.h"

namespace vellum::inspect
{

// A rectangle of the UV plane and the pixels that show it. v grows downwards, as in the image.
struct UvWindow {
    double left = 0;
    double top = 0;
    double scale = 1; // pixels for 1 of u or v
    uint32_t width = 0;
    uint32_t height = 0;
};

// Rows of pixels to look for triangles in, for all triangles of a picture: some seconds. Those after it are not drawn.
constexpr uint64_t kMostRows = 1'000'000'000;

class UvRaster
{
public:
    // `rowsLeft`: as kMostRows; is counted down.
    UvRaster(const UvWindow &window, uint64_t &rowsLeft);

    // Gives the triangle's pixels that no triangle before has taken to it. A pixel is taken once, so any number of
    // triangles over each other costs little.
    void add(const TriangleUvs &uvs, int32_t number);
    // Returns whether nothing more can be added.
    [[nodiscard]] bool full() const { return free_ == 0 || rowsLeft_ == 0; }

    // The number given to add(), or -1.
    [[nodiscard]] int32_t at(size_t x, size_t y) const { return numbers_[y * window_.width + x]; }

private:
    // The first free pixel of the row from `x` on; the width if there is none.
    uint32_t nextFree(uint32_t *row, uint32_t x) const;

    UvWindow window_;
    std::vector<int32_t> numbers_;
    std::vector<uint32_t> next_; // in each row, by pixel and one more: itself if free, else one further on
    size_t free_;
    uint64_t &rowsLeft_;
};

// Barycentrics of a place in the UV plane. Of no use where the triangle has no area.
class UvBarycentrics
{
public:
    explicit UvBarycentrics(const TriangleUvs &uvs);

    struct Weights {
        double u = 0;
        double v = 0;
        [[nodiscard]] double w() const { return 1 - u - v; }
    };
    [[nodiscard]] Weights at(double u, double v) const
    {
        const double x = u - originU_;
        const double y = v - originV_;
        return {x * uPerU_ + y * uPerV_, x * vPerU_ + y * vPerV_};
    }
    [[nodiscard]] bool usable() const { return usable_; }
    // The slope of each weight, per unit of the plane: the inverse of the triangle's heights.
    [[nodiscard]] double slopeU() const { return slopeU_; }
    [[nodiscard]] double slopeV() const { return slopeV_; }
    [[nodiscard]] double slopeW() const { return slopeW_; }

private:
    double originU_, originV_;
    double uPerU_ = 0, uPerV_ = 0, vPerU_ = 0, vPerV_ = 0;
    double slopeU_ = 0, slopeV_ = 0, slopeW_ = 0;
    bool usable_ = false;
};

// The bounds of the selected triangles of a material; nothing if none of their coordinates is finite.
struct UvBounds {
    double left = 0, top = 0, right = 1, bottom = 1;
};
std::optional<UvBounds> boundsOf(const InspectedFile &file, uint32_t material);

// Every pixel of the window. `rowsLeft`: as for UvRaster.
Picture drawUvWindow(const InspectedFile &file, uint32_t material, const UvWindow &window, bool outlines,
                     uint64_t &rowsLeft);

struct UvPictureOptions {
    uint32_t edge = 1024; // pixels of a material's longer side
    bool outlines = true;
    bool whole = true; // the unit square, even where the triangles are in a part of it
};

// A panel for each material, with its name, a scale and the shares of states, and a legend. Panels are smaller where
// there are so many that the picture would have more than 64 million pixels. Throws Error where no panel would be
// legible then.
LabelledPicture drawUvSpace(const InspectedFile &file, const UvPictureOptions &options);

} // namespace vellum::inspect
