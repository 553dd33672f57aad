// What `vellum bake` says about what it did.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cli/bake_command.h"
#include "gltf/micromaps/known_surface.h"

namespace vellum::cli
{

struct PrimitiveReport {
    std::string name;
    std::string material;
    size_t triangles = 0;
    std::array<size_t, 4> special{}; // triangles that are one state all over, by State
    size_t varying = 0;              // FileBake: unknown because of their vertices' alpha
    std::array<size_t, 13> levels{}; // the other triangles by level
    std::array<double, 4> states{};  // shares of State, each triangle counted alike
    size_t micromap = 0;             // the number of its micromap
    std::string caution;             // of which renderers it is not true; empty where it is true of all
};

struct MicromapReport {
    size_t triangles = 0;
    size_t bytes = 0; // data and records
};

struct LeftReport {
    std::string name;
    std::string material;
    std::string reason;
    bool hadMicromap = false; // which was removed
};

struct FileReport {
    BakeJob job;
    std::string error; // empty where all went well, and the rest is empty otherwise
    // Why none of the primitives that should have been baked was, although the output was written; empty where one was.
    std::string failure;
    bool replaced = false;
    std::string replacedLoss; // the data that the replaced ones had lost; empty where they had not
    uint64_t inputBytes = 0;
    uint64_t outputBytes = 0;
    std::vector<PrimitiveReport> primitives;
    std::vector<MicromapReport> micromaps;
    std::vector<LeftReport> left;
    std::optional<SurfaceShares> surface;
};

FileReport reportOf(const BakeJob &job, const FileBake &result);

void printLines(const std::vector<FileReport> &files);
void printTable(const std::vector<FileReport> &files);
void printJson(const std::vector<FileReport> &files);

} // namespace vellum::cli
