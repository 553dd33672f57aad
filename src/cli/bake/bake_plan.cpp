// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <map>
#include <new>
#include <optional>

#include "base/error.h"
#include "base/files.h"
#include "base/text.h"
#include "cli/bake/bake.h"
#include "cli/base/files.h"
#include "core/parallel.h"
#include "core/utf8_path.h"
#include "gltf/file/container.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/output_files.h"
#include "gltf/micromaps/document_writer.h"
#include "gltf/primitive.h"
#include "job/file_list.h"
#include "job/log.h"

namespace vellum::cli
{
namespace
{

namespace fs = std::filesystem;

fs::path besideInput(const fs::path &input)
{
    fs::path output = input;
    return output.replace_extension(".omm") += input.extension();
}

// Returns whether vellum bake wrote it. Throws GltfError.
bool isBakeOutput(const fs::path &path)
{
    const Container container = readJson(path);
    return isOwnFile(JsonTree(container.json()).root());
}

// Throws UsageError for IN OUT where both are earlier outputs: *.omm.glb in a folder of two.
void checkOperands(const fs::path &input, const fs::path &output)
{
    std::error_code error;
    if (isStandardStream(input) || !fs::is_regular_file(output, error) || fs::equivalent(input, output, error))
        return;
    try {
        if (!isBakeOutput(input) || !isBakeOutput(output))
            return;
    } catch (const GltfError &) {
        return; // planning or the bake reports it
    }
    throw UsageError(utf8Text(output) + " would be replaced by the bake of " + utf8Text(input) +
                     ", and vellum wrote both: of two operands the second is the output; -o " + utf8Text(output) +
                     " replaces it, and -o FOLDER bakes both");
}

// Returns whether there is nothing at the output, or a file of which nothing is lost: an earlier bake wrote it, or it
// is a copy of the input. Throws GltfError for what is not a file.
bool isReplaceable(const BakeJob &job)
{
    std::error_code error;
    if (isStandardStream(job.output) || !fs::exists(job.output, error))
        return true;
    if (!fs::is_regular_file(job.output, error))
        throw GltfError(utf8Text(job.output) + " cannot be written: it is there already and is not a file");
    try {
        if (isBakeOutput(job.output))
            return true;
    } catch (const GltfError &) {
        // It may be a copy of an input that cannot be read either.
    }
    return sameBytes(job.input, job.output);
}

void checkDistinct(const std::vector<BakeJob> &jobs)
{
    std::map<fs::path, fs::path, LocationOrder> inputOf;
    for (const BakeJob &job : jobs) {
        const auto [found, isNew] = inputOf.try_emplace(locationOf(job.output), job.input);
        if (!isNew)
            throw UsageError(utf8Text(found->second) + " and " + utf8Text(job.input) + " would both be written to " +
                             utf8Text(job.output));
    }
}

// Found before the first job is baked, so that the result does not depend on which is faster.
class Conflicts
{
public:
    // `inputs`: of all shards.
    Conflicts(const std::vector<BakeJob> &jobs, const std::vector<fs::path> &inputs, const BakeCommandOptions &options);
    // Why this job, the next one in order, cannot be baked; empty if it can.
    std::string problemOf(size_t number);
    // The files that its input names.
    [[nodiscard]] const std::vector<fs::path> &namedBy(size_t number) const { return beside_[number].read; }
    // The bytes of its input and these files.
    [[nodiscard]] uint64_t bytesOf(size_t number) const;
    // After the problems of all jobs: throws UsageError for a log or depfile that is another file of this run as well.
    void checkOwnFiles(const BakeCommandOptions &options);

private:
    void readJob(size_t number);
    void addRead(const fs::path &path, const fs::path &input);

    const std::vector<BakeJob> &jobs_;
    bool force_;
    std::vector<FilesBeside> beside_;
    std::vector<std::string> problems_;
    std::vector<char> replaceable_;
    // Files that are read, which need not exist yet, and the input that each belongs to.
    std::map<fs::path, fs::path, LocationOrder> reads_;
    std::map<FileId, fs::path> filesRead_; // those that exist, by whichever name
    struct Write {
        fs::path input;
        fs::path copied; // the file that is copied; empty for an output
    };
    std::map<fs::path, Write, LocationOrder> writes_;
};

void Conflicts::addRead(const fs::path &path, const fs::path &input)
{
    reads_.try_emplace(locationOf(path), input);
    if (const auto id = idOf(path))
        filesRead_.try_emplace(*id, input);
}

Conflicts::Conflicts(const std::vector<BakeJob> &jobs, const std::vector<fs::path> &inputs,
                     const BakeCommandOptions &options)
    : jobs_(jobs), force_(options.force), beside_(jobs.size()), problems_(jobs.size()), replaceable_(jobs.size())
{
    inParallel(threadCount(options.threads), jobs.size(), [this](size_t i) { readJob(i); });
    for (const fs::path &input : inputs)
        addRead(input, input);
    for (size_t i = 0; i < jobs.size(); ++i)
        for (const fs::path &file : beside_[i].read)
            addRead(file, jobs[i].input);
    if (options.files && !isStandardStream(*options.files))
        addRead(*options.files, *options.files);
}

void Conflicts::readJob(size_t number)
{
    const BakeJob &job = jobs_[number];
    try {
        replaceable_[number] = force_ || isReplaceable(job);
        std::optional<Container> container;
        try {
            container = readJson(job.input);
        } catch (const GltfError &) {
            return; // the bake reports it
        }
        const JsonTree tree(container->json());
        beside_[number] = filesBeside(tree.root(), job.input, job.output);
    } catch (const GltfError &error) {
        problems_[number] = error.what();
    } catch (const std::bad_alloc &) {
        problems_[number] = "out of memory";
    }
}

uint64_t Conflicts::bytesOf(size_t number) const
{
    uint64_t bytes = 0;
    const auto add = [&](const fs::path &file) {
        std::error_code error;
        const uintmax_t size = fs::file_size(file, error);
        bytes += error ? 0 : size;
    };
    add(jobs_[number].input);
    for (const fs::path &file : beside_[number].read)
        add(file);
    return bytes;
}

std::string Conflicts::problemOf(size_t number)
{
    const BakeJob &job = jobs_[number];
    if (!problems_[number].empty())
        return problems_[number];
    const auto read = reads_.find(locationOf(job.output));
    const auto id = idOf(job.output);
    const auto fileRead = id ? filesRead_.find(*id) : filesRead_.end();
    for (const fs::path *reader :
         {read != reads_.end() ? &read->second : nullptr, fileRead != filesRead_.end() ? &fileRead->second : nullptr})
        if (reader != nullptr && *reader != job.input)
            return "the output " + utf8Text(job.output) + " is read for " + utf8Text(*reader);
    if (replaceable_[number] == 0)
        return "the output " + utf8Text(job.output) + " exists and was not written by vellum bake; --force replaces it";
    std::map<fs::path, Write, LocationOrder> writes = {{locationOf(job.output), {job.input, {}}}};
    for (const FilesBeside::Copy &copy : beside_[number].copies)
        writes.try_emplace(locationOf(copy.to), Write{job.input, copy.from});
    for (const FilesBeside::Copy &copy : beside_[number].copies)
        if (const auto reader = reads_.find(locationOf(copy.to));
            reader != reads_.end() && !sameBytes(copy.from, copy.to))
            return "the copy " + utf8Text(copy.to) + " is read for " + utf8Text(reader->second);
    for (const auto &[location, write] : writes) {
        const auto other = writes_.find(location);
        if (other != writes_.end() &&
            (write.copied.empty() || other->second.copied.empty() || !sameBytes(write.copied, other->second.copied)))
            return utf8Text(location) + " would be another file for " + utf8Text(other->second.input);
    }
    writes_.merge(writes);
    return "";
}

void Conflicts::checkOwnFiles(const BakeCommandOptions &options)
{
    for (const auto &[option, file] : {std::pair("--log", options.log), std::pair("--depfile", options.depfile)}) {
        if (!file)
            continue;
        const fs::path location = locationOf(*file);
        const auto id = idOf(*file);
        if (reads_.contains(location) || writes_.contains(location) || (id && filesRead_.contains(*id)))
            throw UsageError(std::string(option) + " must be a file of its own, got " + utf8Text(*file));
        addRead(*file, *file);
    }
}

std::vector<BakeJob> listedJobs(const BakeCommandOptions &options)
{
    const fs::path &list = *options.files;
    const std::string name = utf8Text(list);
    std::string text;
    if (isStandardStream(list)) {
        const std::vector<uint8_t> bytes = readStdin();
        text.assign(bytes.begin(), bytes.end());
    } else {
        text = readFile(list);
    }
    std::vector<BakeJob> jobs;
    for (const job::ListedFile &file : job::parseFileList(text, name)) {
        const auto reject = [&](const std::string &what) { throw UsageError(job::lineError(name, file.line, what)); };
        std::error_code ignored;
        if (isStandardStream(file.input) || file.output == "-")
            reject("a list has no standard streams (-)");
        if (fs::is_directory(file.input, ignored))
            reject(utf8Text(file.input) + " is a folder; a list has files");
        jobs.push_back({.input = file.input,
                        .output = file.output      ? outputFor(file.output, file.input)
                                  : options.output ? *options.output / file.input.filename()
                                                   : besideInput(file.input)});
        try {
            checkSuffix(jobs.back().output, {".glb", ".gltf", suffixOf(file.input)});
        } catch (const UsageError &error) {
            reject(error.what());
        }
    }
    return jobs;
}

// Removes the jobs that earlier logs have as done. Returns their number.
size_t removeDone(const BakeCommandOptions &options, std::vector<BakeJob> &jobs)
{
    std::error_code error;
    job::DoneFiles done(digestOf(options));
    for (const fs::path &log : options.resume)
        if (log != options.log || fs::exists(log, error)) // it is made when the first file has ended
            done.add(log);
    if (!done.empty() && !jobs.empty() &&
        std::none_of(jobs.begin(), jobs.end(), [&](const BakeJob &job) { return done.names(job.input, job.output); }))
        std::fprintf(stderr, "vellum: the logs of --resume name none of these files\n");
    const auto others =
        std::ranges::count_if(jobs, [&](const BakeJob &job) { return done.hasOtherOptions(job.input, job.output); });
    if (others != 0)
        std::fprintf(stderr, "vellum: %s done before with other options or another version, and %s baked again\n",
                     counted(static_cast<size_t>(others), "file was", "files were").c_str(),
                     others == 1 ? "is" : "are");
    return std::erase_if(jobs, [&](const BakeJob &job) { return done.contains(job.input, job.output); });
}

} // namespace

std::string ruleOf(const BakeJob &job)
{
    std::vector<fs::path> read;
    if (!isStandardStream(job.input))
        read.push_back(job.input);
    read.insert(read.end(), job.named.begin(), job.named.end());
    return job::depfileRule(job.output, read);
}

BakePlan planBake(const BakeCommandOptions &options)
{
    std::error_code ignored;
    const bool anyFolder = std::any_of(options.inputs.begin(), options.inputs.end(),
                                       [&](const fs::path &input) { return fs::is_directory(input, ignored); });
    const bool several = options.inputs.size() > 1 || anyFolder || options.files;
    if (options.shard && !several)
        throw UsageError("--shard divides several files; one input cannot be divided");
    if (several && options.output && isStandardStream(*options.output))
        throw UsageError("several inputs need an output folder, not stdout");
    if (several && !options.output && !options.files)
        throw UsageError(options.inputs.size() > 1 ? "several inputs need an output folder: -o FOLDER"
                                                   : utf8Text(options.inputs.front()) +
                                                         " is a folder, which needs an output folder: -o FOLDER");
    const bool toFolder =
        options.output && (several || !options.output->has_filename() || fs::is_directory(*options.output, ignored));
    if (toFolder && fs::exists(*options.output, ignored) && !fs::is_directory(*options.output, ignored))
        throw UsageError(utf8Text(*options.output) + " is a file, and several inputs need an output folder");
    if (several && options.output && !fs::exists(*options.output, ignored) && isGltfName(*options.output))
        throw UsageError(utf8Text(*options.output) +
                         " is the name of a file, and several inputs need an output folder");
    const fs::path output = toFolder ? fs::weakly_canonical(*options.output, ignored) : fs::path();
    if (toFolder && !options.inputs.empty() && isStandardStream(options.inputs.front()))
        throw UsageError("stdin needs an output file, not a folder");
    if (options.output && !toFolder) {
        const std::string suffix = suffixOf(options.inputs.front());
        checkSuffix(*options.output, {".glb", ".gltf", suffix});
        if (!suffix.empty() && !isStandardStream(*options.output) && suffixOf(*options.output).empty())
            throw UsageError(utf8Text(*options.output) + " is no folder: the name of a file ends in " + suffix +
                             ", that of a new folder in /");
    }
    if (options.operandOutput && !toFolder && !options.force)
        checkOperands(options.inputs.front(), *options.output);
    std::vector<BakeJob> jobs;
    if (options.files)
        jobs = listedJobs(options);
    for (const fs::path &input : options.inputs) {
        if (fs::is_directory(input, ignored)) {
            // Outputs below the folder are not baked again.
            const fs::path folder = fs::weakly_canonical(input, ignored);
            if (output == folder)
                throw UsageError(utf8Text(input) + " is also the output folder, and no input is written: name another");
            const bool within = isInside(output, folder);
            for (const fs::path &file : gltfFilesIn(input, within ? output : fs::path()))
                jobs.push_back({.input = file, .output = *options.output / file.lexically_relative(input)});
        } else {
            jobs.push_back({.input = input,
                            .output = toFolder         ? *options.output / input.filename()
                                      : options.output ? *options.output
                                                       : besideInput(input)});
        }
    }
    if (jobs.empty())
        throw Error(options.files ? utf8Text(*options.files) + " lists no files"
                                  : utf8Text(options.inputs.front()) + " has no .glb or .gltf files");
    checkDistinct(jobs);
    std::vector<fs::path> inputs;
    for (const BakeJob &job : jobs)
        inputs.push_back(job.input);
    if (options.shard)
        std::erase_if(jobs, [&](const BakeJob &job) { return !job::isInShard(job.output, *options.shard); });
    const size_t done = removeDone(options, jobs);
    Conflicts conflicts(jobs, inputs, options);
    for (size_t i = 0; i < jobs.size(); ++i) {
        jobs[i].bytes = conflicts.bytesOf(i);
        jobs[i].named = conflicts.namedBy(i);
        jobs[i].problem = conflicts.problemOf(i);
    }
    conflicts.checkOwnFiles(options);
    if (options.depfile) // it is written last; a name that it cannot have is found first
        for (const BakeJob &job : jobs)
            static_cast<void>(ruleOf(job));
    return {std::move(jobs), done};
}

void UnmatchedExclusions::note(const Document &document)
{
    const std::lock_guard lock(noting_);
    const auto eraseMatched = [](std::vector<std::string> &patterns, const std::string &name) {
        std::erase_if(patterns, [&](const std::string &pattern) { return matchesPattern(name, pattern); });
    };
    const gltf_json::Model &model = document.model();
    for (size_t i = 0; i < model.materials.size(); ++i)
        eraseMatched(materials_, materialName(model, i));
    for (const gltf_json::Mesh &mesh : model.meshes)
        eraseMatched(meshes_, mesh.name);
}

void UnmatchedExclusions::noteUnread()
{
    const std::lock_guard lock(noting_);
    materials_.clear();
    meshes_.clear();
}

void UnmatchedExclusions::print() const
{
    for (const std::string &pattern : materials_)
        std::fprintf(stderr, "vellum: --exclude-material %s matches no material\n", pattern.c_str());
    for (const std::string &pattern : meshes_)
        std::fprintf(stderr, "vellum: --exclude-mesh %s matches no mesh\n", pattern.c_str());
}

} // namespace vellum::cli
