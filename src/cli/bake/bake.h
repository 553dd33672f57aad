// SPDX-License-Identifier: Apache-2.0
// `vellum bake`: its options, what it bakes, and mistakes in what it excludes.
#pragma once

#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "gltf/micromaps/document_bake.h"
#include "gltf/micromaps/file_bake.h"
#include "job/shard.h"

namespace CLI
{
class App;
}

namespace vellum::cli
{

struct BakeCommandOptions {
    std::vector<std::filesystem::path> inputs;   // files and folders; "-" is stdin
    std::optional<std::filesystem::path> files;  // a list of files, in place of them; "-" is stdin
    std::optional<job::Shard> shard;             // bakes only these
    std::optional<std::filesystem::path> log;    // gets a line for each file
    std::vector<std::filesystem::path> resume;   // earlier logs: what is done is not baked again
    std::optional<std::filesystem::path> output; // "-" is stdout
    bool operandOutput = false;                  // `output` was given without -o
    std::optional<std::filesystem::path> depfile;
    std::filesystem::path cache;            // empty: none
    uint64_t cacheSize = uint64_t{5} << 30; // bytes
    FileBakeOptions bake;
    unsigned threads = 0; // 0: one for each processor
    bool force = false;   // replaces any file
    bool dryRun = false;  // writes nothing
    bool copy = false;    // writes files in which nothing is baked as well
    bool table = false;
    bool json = false;
    bool quiet = false;
};

// Declares the options that say how to bake, for every command that bakes. The function that is returned completes
// `options` once the command line is parsed; it throws UsageError.
std::function<void()> declareBaking(CLI::App &command, DocumentBakeOptions &options);

// Returns nothing for "auto". Throws UsageError.
std::optional<uint32_t> parseLevel(const std::string &text);

// The value of an option: "1500", "64K", "2M" or "1G", with steps of 1024. Throws UsageError.
uint64_t parseBytes(const std::string &option, const std::string &text);

struct BakeJob {
    std::filesystem::path input;
    std::filesystem::path output;
    std::string problem;                      // why it cannot be baked; empty if it can
    uint64_t bytes = 0;                       // of the input and the files that it names
    std::vector<std::filesystem::path> named; // these files
};

// The job's rule of a depfile. Throws Error.
std::string ruleOf(const BakeJob &job);

struct BakePlan {
    std::vector<BakeJob> jobs; // of the shard, without those that earlier logs have as done
    size_t done = 0;           // the number of these
};

// Plans the bakes and their outputs. Throws UsageError if that is unclear or two outputs are the same file, of any
// shard. A job gets a problem if it would replace a file that another one in the plan reads or writes, an input of any
// shard, or a file that vellum did not write. Only files of the plan are read.
BakePlan planBake(const BakeCommandOptions &options);

// A digest of the options that outputs depend on, for logs.
std::string digestOf(const BakeCommandOptions &options);

// Bakes all files and prints the report. Returns the exit code.
int bakeCommand(BakeCommandOptions &options);

// The patterns that match nothing in any of the documents. Several threads may note documents.
class UnmatchedExclusions
{
public:
    explicit UnmatchedExclusions(const DocumentBakeOptions &options)
        : materials_(options.excludedMaterials), meshes_(options.excludedMeshes)
    {
    }
    void note(const Document &document);
    // A document that was not read: any pattern may match in it.
    void noteUnread();
    // Writes to stderr, one line each.
    void print() const;

private:
    std::mutex noting_;
    std::vector<std::string> materials_;
    std::vector<std::string> meshes_;
};

} // namespace vellum::cli
