// SPDX-License-Identifier: Apache-2.0
// The contents of a glTF file that concern micromaps.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/json_writer.h"
#include "inspect/report_parts.h"

namespace vellum::cli
{

struct FileReport {
    struct Image {
        uint64_t bytes = 0; // encoded
        uint32_t width = 0; // 0 if it cannot be read; see `problem`
        uint32_t height = 0;
        std::string type;
        std::string problem;
    };
    struct Extension {
        std::string name;
        bool required = false;
    };

    std::filesystem::path path;
    bool binary = false;
    uint64_t bytes = 0;
    std::vector<Extension> extensions; // used by the file
    uint64_t scenes = 0, nodes = 0, meshes = 0, primitives = 0, triangles = 0, maskedTriangles = 0;
    std::map<std::string, std::vector<std::string>> materials; // names by alphaMode
    std::vector<Image> images;
    std::string micromapExtension; // empty if it has none
    std::vector<MicromapSummary> micromaps;
    uint64_t micromapPrimitives = 0;
    std::vector<SkippedPrimitive> skipped; // alpha-tested primitives that vellum bake would skip
    std::vector<MicromapFinding> findings; // against the rules of the micromaps' extension
    std::vector<MicromapFinding> problems; // parts that cannot be read
};

FileReport reportFile(const Document &document);

// Without `verbose`, long lists are truncated.
void print(const FileReport &report, bool verbose);
void write(const FileReport &report, JsonWriter &json);

} // namespace vellum::cli
