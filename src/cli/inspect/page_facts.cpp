#include "cli/inspect/page_facts.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <set>

#include "cli/inspect/drawing/thumbnail.h"
#include "cli/inspect/encoding.h"
#include "cli/inspect/tally.h"
#include "cli/renderer/state_table.h"

namespace vellum::cli
{
namespace
{

constexpr std::uint32_t kThumbnailEdge = 360;

// Members of a JSON object in the making.
class Members
{
public:
    Members &raw(const char *name, const std::string &json)
    {
        m_text += fmt::format("{}\"{}\":{}", m_text.empty() ? "" : ",", name, json);
        return *this;
    }
    Members &text(const char *name, std::string_view value) { return raw(name, jsonString(value)); }
    template <typename Number>
    Members &number(const char *name, Number value)
    {
        return raw(name, fmt::format("{}", value));
    }
    template <typename Numbers>
    Members &numbers(const char *name, const Numbers &values)
    {
        return raw(name, fmt::format("[{}]", fmt::join(values, ",")));
    }
    [[nodiscard]] std::string object() const { return "{" + m_text + "}"; }

private:
    std::string m_text;
};

std::string array(const std::vector<std::string> &elements)
{
    return fmt::format("[{}]", fmt::join(elements, ","));
}

std::string tallyJson(const Tally &tally)
{
    std::vector<std::string> levels;
    for (const auto &level : tally.levels)
        levels.push_back(fmt::format("[{},{}]", level[0], level[1]));
    return Members()
        .number("triangles", tally.triangles)
        .number("sharing", tally.sharing)
        .raw("levels", array(levels))
        .numbers("special", tally.special)
        .numbers("states", tally.states)
        .numbers("uvArea", tally.uvArea)
        .number("records", tally.recordsUsed)
        .number("dataBytes", tally.dataBytes)
        .number("indexBytes", tally.indexBytes)
        .object();
}

std::string pngUri(const Picture &picture)
{
    return "data:image/png;base64," + base64(encodePng(picture, Colors::WithAlpha));
}

Picture pictureOf(const Image &image)
{
    Picture picture{image.width, image.height, std::vector<std::uint32_t>(image.rgba.size() / 4)};
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

std::string materialJson(const InspectedFile &file, std::uint32_t number, const PageData &data,
                         const PageLimits &limits)
{
    const InspectedMaterial &material = file.materials[number];
    const Material &m = material.material;
    Members members;
    members.number("index", material.index)
        .text("name", m.name)
        .text("mode", m.alphaMode == AlphaMode::Mask    ? "MASK"
                      : m.alphaMode == AlphaMode::Blend ? "BLEND"
                                                        : "OPAQUE")
        .number("cutoff", std::isfinite(m.alphaCutoff) ? m.alphaCutoff : 0)
        .number("alphaFactor", std::isfinite(m.baseColor[3]) ? m.baseColor[3] : 1)
        .raw("wrap", fmt::format("[\"{}\",\"{}\"]", nameOf(m.wrapU), nameOf(m.wrapV)))
        .text("filter", m.filter == Filter::Nearest ? "nearest" : "bilinear")
        .number("firstShape", data.firstShape[number])
        .number("endShape", data.firstShape[number + 1])
        .raw("tally", tallyJson(tallyOfMaterial(file, number)))
        .text("problem", material.problem);
    if (!material.image.rgba.empty())
        members.number("width", material.image.width)
            .number("height", material.image.height)
            .text("texture", pngUri(pictureOf(scaledDown(material.image, limits.textureEdge))));
    return members.object();
}

std::string primitiveJson(const InspectedFile &file, const InspectedPrimitive &primitive, std::uint32_t first,
                          std::uint32_t end)
{
    return Members()
        .number("mesh", primitive.place.mesh)
        .text("name", primitive.mesh)
        .number("primitive", primitive.place.primitive)
        .number("material", primitive.material)
        .number("triangles", primitive.triangles)
        .number("first", first)
        .number("end", end)
        .raw("tally", tallyJson(tallyOf(file, primitive)))
        .object();
}

std::string meshesJson(const Document &document, const InspectedFile &file, const PageLimits &limits)
{
    std::vector<std::string> meshes;
    std::set<std::uint32_t> drawn;
    for (const InspectedPrimitive &primitive : file.primitives) {
        if (drawn.size() == limits.thumbnails || !drawn.insert(primitive.place.mesh).second)
            continue;
        meshes.push_back(Members()
                             .number("mesh", primitive.place.mesh)
                             .text("name", primitive.mesh)
                             .text("picture", pngUri(drawMesh(document, file, primitive.place.mesh, kThumbnailEdge)))
                             .object());
    }
    return array(meshes);
}

std::string fileJson(const InspectedFile &file)
{
    std::set<std::uint32_t> meshes;
    std::uint64_t dataBytes = 0;
    std::uint64_t records = 0;
    for (const StoredMicromap &micromap : file.stored.micromaps) {
        dataBytes += micromap.data.size();
        records += micromap.triangles.size();
    }
    for (const InspectedPrimitive &primitive : file.primitives)
        meshes.insert(primitive.place.mesh);
    return Members()
        .text("name", file.name)
        .number("bytes", file.bytes)
        .raw("baked", file.baked ? "true" : "false")
        .text("extension", file.stored.extension)
        .number("micromaps", file.stored.micromaps.size())
        .number("records", records)
        .number("dataBytes", dataBytes)
        .number("meshes", file.meshCount)
        .number("inspectedMeshes", meshes.size())
        .number("primitives", file.primitiveCount)
        .number("micromapPrimitives", file.stored.primitives.size())
        .object();
}

} // namespace

Image scaledDown(const Image &image, std::uint32_t edge)
{
    const std::uint32_t factor = (std::max(image.width, image.height) + edge - 1) / edge;
    if (factor <= 1)
        return image;
    Image small{(image.width + factor - 1) / factor, (image.height + factor - 1) / factor, {}};
    small.rgba.reserve(std::size_t{4} * small.width * small.height);
    for (std::uint32_t y = 0; y < small.height; ++y)
        for (std::uint32_t x = 0; x < small.width; ++x)
            for (std::size_t channel = 0; channel < 4; ++channel) {
                std::uint32_t sum = 0;
                std::uint32_t count = 0;
                for (std::size_t v = y * factor; v < std::min((y + 1) * factor, image.height); ++v)
                    for (std::size_t u = x * factor; u < std::min((x + 1) * factor, image.width); ++u, ++count)
                        sum += image.rgba[4 * (v * image.width + u) + channel];
                small.rgba.push_back(static_cast<std::uint8_t>((sum + count / 2) / count));
            }
    return small;
}

std::string pageFacts(const Document &document, const InspectedFile &file, const PageData &data,
                      const PageLimits &limits)
{
    std::vector<std::string> materials;
    for (std::uint32_t m = 0; m < file.materials.size(); ++m)
        materials.push_back(materialJson(file, m, data, limits));
    std::vector<std::string> primitives;
    for (std::size_t p = 0; p < file.primitives.size(); ++p)
        primitives.push_back(primitiveJson(file, file.primitives[p], data.firstTriangle[p], data.firstTriangle[p + 1]));
    std::vector<std::string> colors;
    for (const std::uint32_t color : kStateColors)
        colors.push_back(fmt::format("\"#{:06x}\"", color));
    return Members()
        .raw("file", fileJson(file))
        .raw("tally", tallyJson(tallyOf(file)))
        .raw("stateColors", array(colors))
        .raw("materials", array(materials))
        .raw("primitives", array(primitives))
        .raw("meshes", meshesJson(document, file, limits))
        .number("leftOut", data.leftOut)
        .number("records", data.records.size())
        .number("shapes", data.shapes.size())
        .number("triangles", data.shapeOf.size())
        .number("stateBytes", data.states.size())
        .object();
}

} // namespace vellum::cli
