// What a glTF file has that matters to micromaps.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "gltf/file/json_writer.h"

namespace vellum::cli
{

struct FileReport {
    struct Image {
        uint64_t bytes = 0; // encoded
        uint32_t width = 0; // 0: it cannot be read, and `problem` says why
        uint32_t height = 0;
        std::string type;
        std::string problem;
    };
    struct Micromap {
        uint64_t triangles = 0;
        uint64_t dataBytes = 0;
        std::string contents; // "level 7, 4 states: 10; level 3, 2 states: 5"
    };
    struct Reason {
        std::string place; // `mesh 2 "leaves" primitive 0`
        std::string text;
    };

    std::filesystem::path path;
    bool binary = false;
    uint64_t bytes = 0;
    std::vector<std::string> extensions; // used, those that the file requires marked
    uint64_t scenes = 0, nodes = 0, meshes = 0, primitives = 0, triangles = 0, maskedTriangles = 0;
    std::map<std::string, std::vector<std::string>> materials; // names by alphaMode
    std::vector<Image> images;
    std::string micromapExtension; // empty where it has none
    std::vector<Micromap> micromaps;
    uint64_t micromapPrimitives = 0;
    std::vector<Reason> left;     // alpha-tested primitives that a bake would leave out, and why
    std::vector<Reason> offences; // against the rules of the micromaps' extension
    std::vector<Reason> problems; // what cannot be read
};

// Throws GltfError where it is no glTF file.
FileReport reportFile(const std::filesystem::path &path);

void print(const FileReport &report);
void write(const FileReport &report, JsonWriter &json);

} // namespace vellum::cli
