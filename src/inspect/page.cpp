// SPDX-License-Identifier: Apache-2.0
#include "inspect/page.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <set>

#include "base/json_writer.h"
#include "base/picture.h"
#include "base/text.h"
#include "gltf/file/uri.h"
#include "inspect/inspected_file.h"
#include "inspect/mesh_picture.h"
#include "inspect/page_data.h"
#include "inspect/page_files.h"

namespace vellum::inspect
{
namespace
{

constexpr uint32_t kThumbnailEdge = 360;

void writeTally(const Tally &tally, JsonWriter &json)
{
    json.key("tally").beginObject().member("triangles", tally.triangles).member("sharing", tally.sharing);
    json.list("levels", tally.levels,
              [&](const auto &level) { json.beginArray().value(level[0]).value(level[1]).end(); });
    json.values("special", tally.special).values("states", tally.states).values("uvArea", tally.uvArea);
    json.member("records", tally.recordsUsed).member("dataBytes", tally.dataBytes);
    json.member("indexBytes", tally.indexBytes).end();
}

Picture pictureOf(const Image &image)
{
    Picture picture{image.width, image.height, std::vector<uint32_t>(image.rgba.size() / 4)};
    std::memcpy(picture.pixels.data(), image.rgba.data(), image.rgba.size());
    return picture;
}

const char *nameOf(Wrap wrap)
{
    switch (wrap) {
    case Wrap::Mirror: return "mirror";
    case Wrap::Clamp: return "clamp";
    default: return "repeat";
    }
}

void writeMaterial(const InspectedFile &file, uint32_t number, const PageData &data, const PageLimits &limits,
                   JsonWriter &json)
{
    const InspectedMaterial &material = file.materials[number];
    const Material &m = material.material;
    json.beginObject().member("index", material.index).member("name", m.name);
    json.member("mode", m.alphaMode == AlphaMode::Mask ? "MASK" : m.alphaMode == AlphaMode::Blend ? "BLEND" : "OPAQUE");
    json.key("cutoff");
    material.cutoff ? json.value(*material.cutoff) : json.null();
    json.member("alphaFactor", std::isfinite(m.baseColor[3]) ? m.baseColor[3] : 1);
    json.values("wrap", std::array{nameOf(m.wrapU), nameOf(m.wrapV)});
    json.member("filter", m.filter == Filter::Nearest ? "nearest" : "bilinear");
    json.member("firstShape", data.firstShape[number]).member("endShape", data.firstShape[number + 1]);
    writeTally(tallyOfMaterial(file, number), json);
    json.member("problem", material.problem);
    if (material.image) {
        json.member("width", material.image->width).member("height", material.image->height);
        // Stores each image once for all materials that have it.
        uint32_t first = 0;
        while (file.materials[first].image != material.image)
            ++first;
        if (first == number)
            json.member("texture", pngUri(pictureOf(scaledDown(*material.image, limits.textureEdge)), Alpha::Kept));
        else
            json.member("textureOf", first);
    }
    json.end();
}

void writePrimitive(const InspectedFile &file, const InspectedPrimitive &primitive, uint32_t first, uint32_t end,
                    JsonWriter &json)
{
    json.beginObject().member("mesh", primitive.place.mesh).member("name", primitive.mesh);
    json.member("primitive", primitive.place.primitive).member("material", primitive.material);
    json.member("triangles", primitive.triangles).member("first", first).member("end", end);
    writeTally(tallyOf(file, primitive), json);
    json.end();
}

void writeMeshes(const Document &document, const InspectedFile &file, const PageLimits &limits, JsonWriter &json)
{
    std::set<uint32_t> drawn;
    json.list("meshes", file.primitives, [&](const InspectedPrimitive &primitive) {
        if (drawn.size() == limits.thumbnails || !drawn.insert(primitive.place.mesh).second)
            return;
        json.beginObject().member("mesh", primitive.place.mesh).member("name", primitive.mesh);
        json.member("picture", pngUri(drawMesh(document, file, primitive.place.mesh, kThumbnailEdge), Alpha::Kept))
            .end();
    });
}

void writeFile(const InspectedFile &file, JsonWriter &json)
{
    std::set<uint32_t> meshes;
    uint64_t dataBytes = 0;
    uint64_t records = 0;
    for (const StoredMicromap &micromap : file.stored.micromaps) {
        dataBytes += micromap.data.size();
        records += micromap.triangles.size();
    }
    for (const InspectedPrimitive &primitive : file.primitives)
        meshes.insert(primitive.place.mesh);
    json.key("file").beginObject().member("name", file.name).member("bytes", file.bytes).member("baked", file.baked);
    json.member("extension", file.stored.extension).member("micromaps", file.stored.micromaps.size());
    json.member("records", records).member("dataBytes", dataBytes).member("meshes", file.meshCount);
    json.member("inspectedMeshes", meshes.size()).member("primitives", file.primitiveCount);
    json.member("micromapPrimitives", file.stored.primitives.size());
    if (file.surface)
        json.member("surfaceKnown", file.surface->known())
            .member("surfaceWithout", file.surface->withoutMicromap)
            .member("surfaceTwoStates", file.surface->twoStates);
    json.end();
}

// The part of the page's data that is JSON.
std::string pageFacts(const Document &document, const InspectedFile &file, const PageData &data,
                      const PageLimits &limits)
{
    JsonWriter json(JsonStyle::Html);
    json.beginObject();
    writeFile(file, json);
    writeTally(tallyOf(file), json);
    json.list("stateColors", kStateColors, [&](uint32_t color) {
        char text[8];
        std::snprintf(text, sizeof text, "#%06x", color);
        json.value(text);
    });
    json.key("materials").beginArray();
    for (uint32_t m = 0; m < file.materials.size(); ++m)
        writeMaterial(file, m, data, limits, json);
    json.end().key("primitives").beginArray();
    for (size_t p = 0; p < file.primitives.size(); ++p)
        writePrimitive(file, file.primitives[p], data.firstTriangle[p], data.firstTriangle[p + 1], json);
    json.end();
    writeMeshes(document, file, limits, json);
    json.member("leftOut", data.leftOut).member("records", data.records.size());
    json.member("shapes", data.shapes.size()).member("triangles", data.shapeOf.size());
    return json.member("stateBytes", data.states.size()).end().text();
}

} // namespace

Image scaledDown(const Image &image, uint32_t edge)
{
    const uint32_t factor = (std::max(image.width, image.height) + edge - 1) / edge;
    if (factor <= 1)
        return image;
    Image small{(image.width + factor - 1) / factor, (image.height + factor - 1) / factor, {}};
    small.rgba.reserve(size_t{4} * small.width * small.height);
    for (uint32_t y = 0; y < small.height; ++y)
        for (uint32_t x = 0; x < small.width; ++x)
            for (size_t channel = 0; channel < 4; ++channel) {
                uint32_t sum = 0;
                uint32_t count = 0;
                for (size_t v = y * factor; v < std::min((y + 1) * factor, image.height); ++v)
                    for (size_t u = x * factor; u < std::min((x + 1) * factor, image.width); ++u, ++count)
                        sum += image.rgba[4 * (v * image.width + u) + channel];
                small.rgba.push_back(static_cast<uint8_t>((sum + count / 2) / count));
            }
    return small;
}

std::string makePage(const Document &document, const InspectedFile &file, const PageLimits &limits)
{
    const PageData data = makePageData(file, limits);
    const std::string facts = pageFacts(document, file, data, limits);
    const std::string numbers = base64Encoded(deflated(data.bytes()));
    std::string page;
    page.reserve(facts.size() + numbers.size() + 200'000);
    // The places in page.html where something belongs are comments.
    std::string_view rest = kPage_page_html;
    while (true) {
        const size_t begin = rest.find("<!--@");
        if (begin == std::string_view::npos)
            return page.append(rest);
        const size_t end = rest.find("-->", begin);
        page.append(rest.substr(0, begin));
        const std::string_view what = rest.substr(begin + 5, end - begin - 5);
        if (what == "title")
            page += markupText(file.name);
        else if (what == "style")
            page.append("<style>\n").append(kPage_style_css).append("</style>");
        else if (what == "facts")
            page += "<script type=\"application/json\" id=\"facts\">" + facts + "</script>";
        else if (what == "numbers")
            page += "<script type=\"text/plain\" id=\"numbers\">" + numbers + "</script>";
        else if (what == "script") {
            page += "<script>\n\"use strict\";\n(() => {\n";
            for (const std::string_view script : {kPage_elements_js, kPage_data_js, kPage_index_js, kPage_raster_js,
                                                  kPage_viewer_js, kPage_charts_js, kPage_details_js, kPage_main_js})
                page.append(script);
            page += "})();\n</script>";
        }
        rest.remove_prefix(end + 3);
    }
}

} // namespace vellum::inspect
