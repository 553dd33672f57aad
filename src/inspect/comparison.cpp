// SPDX-License-Identifier: Apache-2.0
#include "inspect/comparison.h"

#include <algorithm>
#include <fmt/format.h>
#include <map>

#include "base/text.h"
#include "inspect/page.h"
#include "inspect/report_parts.h"

namespace vellum::inspect
{
namespace
{

std::string nameOr(const std::string &name, const char *kind, int number)
{
    return !name.empty() ? name : number < 0 ? fmt::format("no {}", kind) : fmt::format("{} {}", kind, number);
}

std::string materialOf(const InspectedSurface &surface)
{
    return nameOr(surface.material, "material", surface.materialIndex);
}

std::string meshOf(const InspectedSurface &surface)
{
    return nameOr(surface.mesh, "mesh", static_cast<int>(surface.place.mesh));
}

// What a file has under one name.
struct PartOfFile {
    double area = 0;
    double known = 0;
    std::vector<const InspectedPrimitive *> primitives;
};

using NameOf = std::string (*)(const InspectedSurface &);

std::map<std::string, PartOfFile> partsOfFile(const InspectedFile &file, NameOf nameOf)
{
    std::map<std::string, PartOfFile> parts;
    for (const InspectedSurface &surface : file.surfaces) {
        PartOfFile &part = parts[nameOf(surface)];
        part.area += surface.area;
        part.known += surface.known;
        const auto primitive =
            std::lower_bound(file.primitives.begin(), file.primitives.end(), surface.place,
                             [](const InspectedPrimitive &p, PrimitivePlace place) { return p.place < place; });
        if (primitive != file.primitives.end() && !(surface.place < primitive->place))
            part.primitives.push_back(&*primitive);
    }
    return parts;
}

ComparedBake bakeOf(const InspectedFile &file, const PartOfFile &part)
{
    ComparedBake bake;
    if (part.area > 0)
        bake.known = part.known / part.area;
    const Tally tally = tallyOf(file, part.primitives);
    bake.bytes = tally.dataBytes + tally.recordsUsed * sizeof(MicromapTriangle);
    bake.triangles = tally.triangles;
    for (size_t level = 0; level < bake.levels.size(); ++level) {
        bake.levels[level] = tally.levels[level][0] + tally.levels[level][1];
        bake.twoStates = bake.twoStates || tally.levels[level][0] != 0;
    }
    return bake;
}

std::vector<ComparedPart> compareParts(const std::array<const InspectedFile *, 2> &files, NameOf nameOf)
{
    std::vector<ComparedPart> parts;
    std::map<std::string, size_t> numbers;
    for (const InspectedFile *file : files)
        for (const InspectedSurface &surface : file->surfaces)
            if (const std::string name = nameOf(surface); numbers.try_emplace(name, parts.size()).second)
                parts.push_back({name, {}});
    for (size_t i = 0; i < 2; ++i)
        for (const auto &[name, part] : partsOfFile(*files[i], nameOf))
            parts[numbers[name]].bakes[i] = bakeOf(*files[i], part);
    return parts;
}

std::string levelsText(const ComparedBake &bake)
{
    std::string text;
    for (size_t level = 0; level < bake.levels.size(); ++level)
        if (bake.levels[level] != 0)
            text += fmt::format("{}{}", text.empty() ? "" : " ", level);
    return text.empty() ? "-" : text;
}

std::string knownText(const std::optional<ComparedBake> &bake)
{
    return bake && bake->known ? percent(*bake->known) + (bake->twoStates ? " in 2 states" : "") : "-";
}

// Known of both, bytes of both, levels of both.
std::array<std::string, 6> cellsOf(const ComparedPart &part)
{
    std::array<std::string, 6> cells;
    for (size_t i = 0; i < 2; ++i) {
        const std::optional<ComparedBake> &bake = part.bakes[i];
        cells[i] = knownText(bake);
        cells[2 + i] = bake ? grouped(bake->bytes) : "-";
        cells[4 + i] = bake ? levelsText(*bake) : "-";
    }
    return cells;
}

constexpr std::array kHeads = {"surface known", "", "bytes", "", "levels", ""};

} // namespace

Comparison compare(const InspectedFile &first, const InspectedFile &second)
{
    const std::array<const InspectedFile *, 2> files = {&first, &second};
    Comparison comparison;
    comparison.files = {first.name, second.name};
    comparison.all = compareParts(files, [](const InspectedSurface &) { return std::string("all"); }).front();
    for (size_t i = 0; i < 2; ++i) {
        comparison.all.bakes[i]->bytes = 0;
        for (const StoredMicromap &micromap : files[i]->stored.micromaps)
            comparison.all.bakes[i]->bytes += micromap.bytes();
    }
    comparison.materials = compareParts(files, materialOf);
    comparison.meshes = compareParts(files, meshOf);
    return comparison;
}

std::string textOf(const Comparison &comparison)
{
    std::vector<std::vector<std::string>> rows = {{"", kHeads[0], "", kHeads[2], "", kHeads[4], ""},
                                                  {"", "first", "second", "first", "second", "first", "second"}};
    const auto add = [&](const ComparedPart &part, const std::string &indent) {
        const std::array<std::string, 6> cells = cellsOf(part);
        rows.push_back({indent + part.name});
        rows.back().insert(rows.back().end(), cells.begin(), cells.end());
    };
    add(comparison.all, "");
    rows.push_back({"by material"});
    for (const ComparedPart &part : comparison.materials)
        add(part, "  ");
    rows.push_back({"by mesh"});
    for (const ComparedPart &part : comparison.meshes)
        add(part, "  ");
    return fmt::format("first: {}\nsecond: {}\n{}", comparison.files[0], comparison.files[1], alignedRows(rows, 1, ""));
}

std::string pageOf(const Comparison &comparison)
{
    const auto bar = [](const std::optional<ComparedBake> &bake) {
        return bake && bake->known
                   ? fmt::format("<b class=\"bar\"><i style=\"width: {:.1f}%\"></i></b>", 100 * *bake->known)
                   : std::string();
    };
    const auto table = [&](const char *kind, const std::vector<ComparedPart> &parts) {
        std::string html = fmt::format(
            "<div class=\"scroll\"><table>\n<tr><th>{}<th colspan=\"2\">{}<th colspan=\"2\">{}<th colspan=\"2\">{}"
            "</tr>\n<tr><th>",
            kind, kHeads[0], kHeads[2], kHeads[4]);
        for (size_t i = 0; i < 6; ++i)
            html += i % 2 == 0 ? "<th>first" : "<th>second";
        html += "</tr>\n";
        for (const ComparedPart &part : parts) {
            const std::array<std::string, 6> cells = cellsOf(part);
            html += fmt::format("<tr><td>{}", markupText(part.name));
            for (size_t i = 0; i < cells.size(); ++i)
                html += "<td>" + cells[i] + (i < 2 ? bar(part.bakes[i]) : "");
            html += "</tr>\n";
        }
        return html + "</table></div>\n";
    };
    const std::string body =
        fmt::format("<p>First: {}<br>Second: {}</p>\n", markupText(comparison.files[0]),
                    markupText(comparison.files[1])) +
        table("", {comparison.all}) + "<h2>By material</h2>\n" + table("material", comparison.materials) +
        "<h2>By mesh</h2>\n" + table("mesh", comparison.meshes) +
        "<p class=\"muted\">Surface known: the share of the alpha-tested surface of the scene that is opaque or "
        "transparent. What has no micromap is unknown. With 2 states nothing else is, and a part of it is approximate: "
        "outlines follow the micro-triangles. Bytes are those of states and of micromap triangles; what "
        "several materials or meshes share counts for each of them.</p>";
    return plainPage(comparison.files[0] + " and " + comparison.files[1], body);
}

void write(const Comparison &comparison, JsonWriter &json)
{
    const auto writePart = [&](const ComparedPart &part) {
        json.beginObject().member("name", part.name);
        for (size_t i = 0; i < 2; ++i) {
            json.key(i == 0 ? "first" : "second");
            const std::optional<ComparedBake> &bake = part.bakes[i];
            if (!bake) {
                json.null();
                continue;
            }
            json.beginObject().key("known");
            bake->known ? json.value(*bake->known) : json.null();
            json.member("bytes", bake->bytes).member("triangles", bake->triangles);
            writeLevels(bake->levels, json);
            json.end();
        }
        json.end();
    };
    json.beginObject().key("all");
    writePart(comparison.all);
    json.list("materials", comparison.materials, writePart);
    json.list("meshes", comparison.meshes, writePart);
    json.end();
}

} // namespace vellum::inspect
