// SPDX-License-Identifier: Apache-2.0
// HTML pages that need no other file: that of `vellum inspect`, with its data, and others.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "inspect/inspected_file.h"

namespace vellum::inspect
{

// Bounds of what a page may hold, whatever the file does.
struct PageLimits {
    size_t stateBytes = size_t{16} << 20; // of all micromap triangles in the page
    size_t triangles = 2'000'000;         // the others are in the numbers only
    size_t thumbnails = 48;
    uint32_t textureEdge = 2048; // larger textures are scaled down
};

// Triangles with the same coordinates and the same states are drawn once: a shape.
struct PageShape {
    TriangleUvs uvs;
    int32_t record = 0; // into the page's records, or a special index
};

// A micromap triangle in the page. Its states may be those of a lower level, of which each is what most of its part is.
struct PageRecord {
    uint8_t level = 0;
    uint8_t pageLevel = 0;
    Format format = Format::FourState;
    StateCounts states{};   // at its own level
    uint32_t firstByte = 0; // into PageData::states; from there 4-state data of pageLevel
};

// The data of the page, which page/data.js reads: JSON has what is text.
struct PageData {
    std::vector<PageRecord> records;
    std::vector<PageShape> shapes;       // sorted by material
    std::vector<uint32_t> firstShape;    // by material, and one more
    std::vector<uint32_t> shapeOf;       // of each triangle, one primitive after another
    std::vector<uint32_t> numbers;       // of each triangle in its primitive
    std::vector<uint32_t> firstTriangle; // by primitive, and one more
    std::vector<uint8_t> states;
    size_t leftOut = 0; // triangles, for PageLimits::triangles

    // Packs the data into bytes, every array beginning at a multiple of 4: records (8 bits each for level, pageLevel,
    // format and nothing; 32 each for firstByte and four counts), shapes (six floats, record), shapeOf, numbers,
    // states.
    [[nodiscard]] std::vector<uint8_t> bytes() const;
};

PageData makePageData(const InspectedFile &file, const PageLimits &limits);

// The page of `vellum inspect`.
std::string makePage(const Document &document, const InspectedFile &file, const PageLimits &limits = {});

// The text of a page with a part in place of each comment <!--@NAME-->.
std::string filledPage(std::string_view page, const std::map<std::string_view, std::string> &parts);
// Elements for such parts: a style sheet, and a script whose names are its own.
std::string styleElement(std::string_view css);
std::string scriptElement(std::string_view script);

// A page without scripts: a heading, and a body that is HTML already. Tables, .chosen rows and .muted paragraphs have a
// style; so have <b class="bar"><i style="width: 40%"></i></b>.
std::string plainPage(const std::string &title, const std::string &body);

} // namespace vellum::inspect
