// SPDX-License-Identifier: Apache-2.0
// `vellum bake`: the run, and its report.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <mutex>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/files.h"
#include "base/process.h"
#include "base/progress.h"
#include "base/text.h"
#include "cli/bake/bake.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "core/parallel.h"
#include "core/utf8_path.h"
#include "gltf/file/cache_folder.h"
#include "gltf/file/gltf_error.h"
#include "gltf/micromaps/known_surface.h"
#include "inspect/report_parts.h"
#include "job/log.h"

namespace vellum::cli
{
namespace
{

struct BakedReport {
    std::string primitive; // `mesh 2 "leaves" primitive 0`
    std::string material;
    size_t triangles = 0;
    std::array<size_t, 4> special{};   // triangles with a special index, by State
    size_t varying = 0;                // triangles that are unknown because the alphas of their vertices differ
    std::array<uint64_t, 13> levels{}; // the other triangles by level
    std::array<double, 4> states{};    // shares of State, each triangle counted alike
    size_t micromap = 0;               // the number of its micromap
    std::string caution;               // BakedPrimitive::caution
};

struct BakeFileReport {
    BakeJob job;
    ExitCode code = ExitCode::Success;
    bool ended = true; // false: it was not baked because of an interruption or a full disk
    std::string error; // in one line; empty if the file was baked. Otherwise nothing below is known
    // Why no primitive was baked although some should have been: something is not supported, or micromaps are required.
    // Empty if one was.
    std::string failure;
    bool replaced = false;
    std::string replacedLoss; // lossOfMicromaps() of the micromaps that were replaced
    bool written = false;
    uint64_t inputBytes = 0;
    uint64_t outputBytes = 0;                                      // 0 if nothing was written
    std::vector<std::pair<std::filesystem::path, uint64_t>> files; // FileBake::files
    std::vector<BakedReport> primitives;
    std::vector<MicromapSummary> micromaps;
    uint64_t indexBytes = 0; // of the micromap indices of all primitives
    std::vector<SkippedPrimitive> skipped;
    std::optional<SurfaceShares> surface;
    size_t cacheHits = 0; // and misses: both 0 without a cache
    size_t cacheMisses = 0;
};

BakedReport reportOf(const BakedPrimitive &primitive, const StoredMicromap &micromap,
                     const std::vector<std::array<double, 4>> &shares)
{
    BakedReport report;
    report.primitive = primitive.name;
    report.material = primitive.material;
    report.triangles = primitive.micromap.indices.size();
    report.varying = primitive.varying;
    report.micromap = primitive.micromap.micromap;
    report.caution = primitive.caution;
    for (const int32_t index : primitive.micromap.indices) {
        if (const auto special = specialState(index)) {
            ++report.special[static_cast<size_t>(*special)];
            ++report.states[static_cast<size_t>(*special)];
            continue;
        }
        const auto triangle = static_cast<uint32_t>(index) + primitive.micromap.baseTriangle;
        ++report.levels[micromap.triangles[triangle].subdivisionLevel];
        for (size_t s = 0; s < 4; ++s)
            report.states[s] += shares[triangle][s];
    }
    for (double &state : report.states)
        state /= static_cast<double>(std::max<size_t>(report.triangles, 1));
    return report;
}

// `; 2 alpha-tested primitives skipped (alphaMode BLEND: 1 primitive of 1 material; --blend bakes it)`, or empty.
std::string skippedText(const BakeFileReport &file)
{
    if (file.skipped.empty())
        return "";
    std::string text = fmt::format("; {} skipped", counted(file.skipped.size(), "alpha-tested primitive"));
    size_t blended = 0;
    std::set<std::string> materials;
    for (const SkippedPrimitive &skipped : file.skipped)
        if (skipped.code == SkipReason::AlphaModeBlend) {
            ++blended;
            materials.insert(skipped.material);
        }
    if (blended != 0)
        text += fmt::format(" (alphaMode BLEND: {} of {}; --blend bakes {})", counted(blended, "primitive"),
                            counted(materials.size(), "material"), blended == 1 ? "it" : "them");
    return text;
}

double knownShare(const std::vector<BakedReport> &primitives)
{
    double known = 0;
    double all = 0;
    for (const BakedReport &primitive : primitives) {
        known += (primitive.states[0] + primitive.states[1]) * static_cast<double>(primitive.triangles);
        all += static_cast<double>(primitive.triangles);
    }
    return all > 0 ? known / all : 0;
}

size_t micromapBytes(const BakeFileReport &file)
{
    size_t bytes = 0;
    for (const MicromapSummary &micromap : file.micromaps)
        bytes += micromap.bytes;
    return bytes;
}

// "tree.glb -> tree.omm.glb"
std::string namesOf(const BakeJob &job)
{
    return utf8Text(job.input) + " -> " + utf8Text(job.output);
}

// Of a file without a scene to measure.
std::string describeTriangles(const BakeFileReport &file)
{
    const bool approximate = std::any_of(file.micromaps.begin(), file.micromaps.end(), [](const MicromapSummary &m) {
        return std::any_of(m.levels.begin(), m.levels.end(), [](const auto &entry) { return entry.first.second == 2; });
    });
    const std::string share = percent(knownShare(file.primitives)) + " of triangles are ";
    return approximate ? share + "opaque or transparent, some in " + kTwoStatesText : share + "known";
}

// The caution that all primitives with one have in common, or how many there are.
std::string cautionText(const BakeFileReport &file)
{
    std::set<std::string> cautions;
    size_t primitives = 0;
    for (const BakedReport &primitive : file.primitives)
        if (!primitive.caution.empty()) {
            cautions.insert((primitive.material.empty() ? "" : primitive.material + ": ") + primitive.caution);
            ++primitives;
        }
    if (cautions.size() == 1)
        return "; caution: " + *cautions.begin();
    return cautions.empty() ? "" : fmt::format("; {}, see --report", counted(primitives, "caution"));
}

std::string summary(const BakeFileReport &file)
{
    size_t triangles = 0;
    for (const BakedReport &primitive : file.primitives)
        triangles += primitive.triangles;
    const std::string share = file.surface ? describe(*file.surface) : describeTriangles(file);
    const std::string nothing = file.code == ExitCode::Failed ? "nothing could be baked" : "nothing to bake";
    std::string text = file.primitives.empty()
                           ? nothing + (file.written ? "" : ", not written")
                           : fmt::format("{}; {} of micromaps + {} of indices, {}, {}", share,
                                         counted(micromapBytes(file), "byte"), grouped(file.indexBytes),
                                         counted(file.primitives.size(), "primitive"), counted(triangles, "triangle"));
    std::error_code error;
    if (!file.written && std::filesystem::exists(file.job.output, error))
        text += ", the earlier file is left as it is";
    text += skippedText(file);
    const auto lost = std::count_if(file.skipped.begin(), file.skipped.end(),
                                    [](const SkippedPrimitive &s) { return s.hadMicromap; });
    if (lost != 0 && file.written)
        text += fmt::format(" ({} lost {} micromap)", lost, lost == 1 ? "its" : "their");
    if (file.replaced && file.written && !file.primitives.empty())
        text += "; the input had micromaps already, which were replaced";
    if (file.cacheHits + file.cacheMisses != 0)
        text +=
            fmt::format("; cache: {}, {}", counted(file.cacheHits, "hit"), counted(file.cacheMisses, "miss", "misses"));
    return text + cautionText(file);
}

void write(const BakedReport &primitive, JsonWriter &json)
{
    json.beginObject().member("primitive", primitive.primitive).member("material", primitive.material);
    json.member("triangles", primitive.triangles).member("micromap", primitive.micromap);
    json.member("varyingAlpha", primitive.varying);
    if (!primitive.caution.empty())
        json.member("caution", primitive.caution);
    writeStates("special", primitive.special, json);
    writeLevels(primitive.levels, json);
    writeStates("states", primitive.states, json);
    json.end();
}

void write(const BakeFileReport &file, JsonWriter &json)
{
    json.beginObject().member("file", utf8Text(file.job.input));
    if (!file.error.empty()) {
        json.member("error", file.error).end();
        return;
    }
    json.member("output", utf8Text(file.job.output));
    json.member("written", file.written).member("bytes", file.inputBytes).member("outputBytes", file.outputBytes);
    if (!file.failure.empty())
        json.member("failure", file.failure);
    json.member("replaced", file.replaced);
    if (!file.replacedLoss.empty())
        json.member("replacedLoss", file.replacedLoss);
    if (file.cacheHits + file.cacheMisses != 0) {
        json.key("cache").beginObject().member("hits", file.cacheHits).member("misses", file.cacheMisses);
        json.end();
    }
    writeSurface(file.surface, json);
    writeMicromaps(file.micromaps, json);
    json.list("primitives", file.primitives, [&](const BakedReport &primitive) { write(primitive, json); });
    writeSkipped(file.skipped, json);
    json.end();
}

// If all primitives that should have been baked have something that is not supported.
std::string failureOf(const BakeJob &job, const DocumentBake &bake)
{
    const auto first = std::find_if(bake.skipped.begin(), bake.skipped.end(),
                                    [](const SkippedPrimitive &skipped) { return skipped.unsupported(); });
    if (!bake.primitives.empty() || first == bake.skipped.end())
        return "";
    return fmt::format("{}: none of its alpha-tested primitives could be baked: {}: {}", utf8Text(job.input),
                       first->name, reasonFor(*first));
}

void printReplacedLoss(const BakeFileReport &file)
{
    if (!file.replacedLoss.empty())
        fmt::print("  replaced: {}\n", file.replacedLoss);
}

void printPrimitives(const BakeFileReport &file)
{
    if (file.primitives.empty())
        return;
    std::vector<std::vector<std::string>> rows = {
        {"primitive", "material", "triangles", "with data", "levels", "transparent", "opaque", "unknown", "micromap"}};
    for (const BakedReport &p : file.primitives)
        rows.push_back({p.primitive, p.material, grouped(p.triangles),
                        grouped(std::accumulate(p.levels.begin(), p.levels.end(), uint64_t{0})), levelsText(p.levels),
                        percent(p.states[0]), percent(p.states[1]), percent(p.states[2] + p.states[3]),
                        std::to_string(p.micromap)});
    fmt::print("{}", alignedRows(rows, 2, "  "));
    fmt::print("  shares are of triangles, each counted alike\n");
}

void printRemarks(const BakeFileReport &file)
{
    for (const BakedReport &p : file.primitives)
        if (p.varying != 0)
            fmt::print("  {}: {} unknown, the alphas of {} vertices (COLOR_0) differ\n", p.primitive,
                       counted(p.varying, "triangle is", "triangles are"), p.varying == 1 ? "its" : "their");
    for (const BakedReport &p : file.primitives)
        if (!p.caution.empty())
            fmt::print("  caution: {}{}: {}\n", p.primitive, p.material.empty() ? "" : fmt::format(" ({})", p.material),
                       p.caution);
    for (const SkippedPrimitive &skipped : file.skipped)
        fmt::print("  skipped: {}{}\n", describe(skipped),
                   skipped.hadMicromap && file.written ? "; its micromap was removed" : "");
}

BakeFileReport reportOf(const BakeJob &job, FileBake result)
{
    BakeFileReport report;
    report.job = job;
    report.failure = failureOf(job, result.bake);
    report.code = report.failure.empty() ? ExitCode::Success : ExitCode::Failed;
    report.replaced = result.replaced;
    report.replacedLoss = std::move(result.replacedLoss);
    report.written = result.written;
    report.inputBytes = result.inputBytes;
    report.outputBytes = result.outputBytes;
    report.files = std::move(result.files);
    report.surface = result.surface;
    report.cacheHits = result.bake.cacheHits;
    report.cacheMisses = result.bake.cacheMisses;
    report.micromaps = summariesOf(result.bake.micromaps);
    report.skipped = std::move(result.bake.skipped);
    std::vector<std::vector<std::array<double, 4>>> shares;
    for (const StoredMicromap &micromap : result.bake.micromaps)
        shares.push_back(stateShares(micromap.triangles, micromap.data));
    for (const BakedPrimitive &primitive : result.bake.primitives) {
        const uint32_t micromap = primitive.micromap.micromap;
        report.primitives.push_back(reportOf(primitive, result.bake.micromaps[micromap], shares[micromap]));
        report.indexBytes +=
            primitive.micromap.indices.size() * micromapIndexBytes(result.bake.micromaps[micromap].triangles.size());
    }
    return report;
}

void printLines(const std::vector<BakeFileReport> &files)
{
    for (const BakeFileReport &file : files)
        if (file.error.empty()) {
            fmt::print("{}: {}\n", file.written ? namesOf(file.job) : utf8Text(file.job.input), summary(file));
            printReplacedLoss(file);
        }
}

void printTable(const std::vector<BakeFileReport> &files)
{
    for (const BakeFileReport &file : files) {
        if (!file.error.empty())
            continue;
        fmt::print("{}: {}\n", namesOf(file.job), summary(file));
        if (file.written)
            fmt::print("  {} bytes became {}\n", grouped(file.inputBytes), grouped(file.outputBytes));
        printReplacedLoss(file);
        printPrimitives(file);
        for (size_t i = 0; i < file.micromaps.size(); ++i)
            fmt::print("  micromap {}: {}, {}\n", i, counted(file.micromaps[i].triangles, "triangle"),
                       counted(file.micromaps[i].bytes, "byte"));
        printRemarks(file);
    }
}

// What became of several files, in a line; of one, why it was not written. Empty if there is nothing to add, and where
// the run ended early, which has a line of its own.
std::string totals(const std::vector<BakeFileReport> &files)
{
    std::array<size_t, 4> counts{};
    auto &[baked, unwritten, copied, failed] = counts;
    for (const BakeFileReport &file : files) {
        if (!file.ended)
            return "";
        ++(file.code != ExitCode::Success ? failed
           : !file.primitives.empty()     ? baked
           : file.written                 ? copied
                                          : unwritten);
    }
    if (files.size() < 2)
        return unwritten == 0 ? ""
                              : "the output was not written, as nothing is baked; --copy writes a copy of the input";
    std::string text = counted(baked, "file") + " baked";
    if (unwritten != 0)
        text += fmt::format(", {} not written (nothing to bake; --copy writes copies)", grouped(unwritten));
    if (copied != 0)
        text += fmt::format(", {} written with nothing baked", grouped(copied));
    if (failed != 0)
        text += fmt::format(", {} failed", grouped(failed));
    return text;
}

// `done`: the number of files that earlier logs have as done.
void printJson(const std::vector<BakeFileReport> &files, size_t done, bool dryRun)
{
    JsonWriter json;
    beginReport(json, "bake");
    json.member("dryRun", dryRun);
    if (done != 0)
        json.member("done", done);
    json.list("files", files, [&](const BakeFileReport &file) { write(file, json); });
    fmt::print("{}\n", json.end().text());
}

namespace fs = std::filesystem;

// Why files cannot be written to certain folders: noticed once, for all files that would follow.
class Storage
{
public:
    // Why the output of a job cannot be written; empty if it can, as far as is known.
    std::string problemOf(const BakeJob &job);
    // After the output of a job could not be written.
    void fail(const BakeJob &job, const GltfStorageError &error, const std::string &reason);
    // The first problem; empty if there was none.
    [[nodiscard]] const std::string &firstProblem() const { return first_; }

private:
    struct Problem {
        std::string reason;
        bool full;       // otherwise nothing can be written
        uint64_t failed; // the bytes of the smallest job that failed
    };

    // The folder of a file, or the one in which that would be made.
    static fs::path existingFolderOf(const fs::path &file);
    // Where the problem is one of this job, too.
    [[nodiscard]] const Problem *problemOf(const BakeJob &job, const fs::path &folder) const;

    std::mutex mutex_;
    std::map<uint64_t, Problem> fileSystems_;
    std::map<FileId, Problem> folders_; // by quotas
    std::string first_;
};

fs::path Storage::existingFolderOf(const fs::path &file)
{
    std::error_code error;
    fs::path folder = fs::absolute(file, error).parent_path();
    while (!fs::is_directory(folder, error) && folder.has_relative_path())
        folder = folder.parent_path();
    return folder;
}

// An output is at least as large as its input.
const Storage::Problem *Storage::problemOf(const BakeJob &job, const fs::path &folder) const
{
    const auto id = idOf(folder);
    if (!id)
        return nullptr;
    std::error_code unknown;
    const uintmax_t least = fs::file_size(job.input, unknown);
    const auto whole = fileSystems_.find(id->first);
    if (whole != fileSystems_.end() &&
        (!whole->second.full || job.bytes >= whole->second.failed || (!unknown && least > freeBytes(folder))))
        return &whole->second;
    const auto quota = folders_.find(*id);
    return quota != folders_.end() && job.bytes >= quota->second.failed ? &quota->second : nullptr;
}

std::string Storage::problemOf(const BakeJob &job)
{
    const fs::path folder = existingFolderOf(job.output);
    const std::string unwritable = problemOfFolder(folder);
    const std::lock_guard lock(mutex_);
    const Problem *const known = problemOf(job, folder);
    const std::string problem = known != nullptr     ? known->reason
                                : unwritable.empty() ? ""
                                                     : utf8Text(folder) + " cannot be written: " + unwritable;
    if (first_.empty())
        first_ = problem;
    return problem;
}

void Storage::fail(const BakeJob &job, const GltfStorageError &error, const std::string &reason)
{
    using Cause = GltfStorageError::Cause;
    const auto id = idOf(existingFolderOf(job.output));
    const std::lock_guard lock(mutex_);
    if (first_.empty())
        first_ = reason;
    if (!id)
        return;
    const Problem problem{reason, error.cause() != Cause::ReadOnly, job.bytes};
    Problem &known = error.cause() == Cause::Quota ? folders_.try_emplace(*id, problem).first->second
                                                   : fileSystems_.try_emplace(id->first, problem).first->second;
    known.full = known.full && problem.full;
    known.failed = std::min(known.failed, problem.failed);
}

struct BakeRun {
    std::vector<BakeFileReport> reports;
    size_t done = 0;      // files that earlier logs have as done
    std::string stopped;  // why files could not be written; empty if they could
    std::string logError; // empty if there is none
};

// Bakes files on several threads: many files at a time, and the last ones with several threads each.
class Bakery
{
public:
    // `log` may be null.
    Bakery(const BakeCommandOptions &options, std::vector<BakeJob> jobs, UnmatchedExclusions &exclusions,
           job::Log *log);
    BakeRun run();

private:
    void bakeNext(size_t i);
    BakeFileReport bakeOne(size_t job, unsigned threads);
    void report(size_t job, double share);
    void log(const BakeFileReport &report, uint64_t milliseconds);

    const BakeCommandOptions &options_;
    UnmatchedExclusions &exclusions_;
    std::vector<BakeJob> jobs_;
    job::Log *log_;
    std::string digest_; // of the options
    Storage storage_;
    DecodedImages images_;
    BakeRun result_;
    std::vector<double> bytes_; // of the inputs
    std::vector<size_t> order_; // the largest first
    unsigned threads_;
    std::mutex reporting_;
    ProgressLine progress_;
    double total_ = 0;
    double done_ = 0;
    std::vector<double> shares_; // of each file, done
};

Bakery::Bakery(const BakeCommandOptions &options, std::vector<BakeJob> jobs, UnmatchedExclusions &exclusions,
               job::Log *log)
    : options_(options), exclusions_(exclusions), jobs_(std::move(jobs)), log_(log), digest_(digestOf(options)),
      order_(jobs_.size()), threads_(threadCount(options.threads)), progress_("baking"), shares_(jobs_.size())
{
    result_.reports.resize(jobs_.size());
    for (const BakeJob &job : jobs_) {
        bytes_.push_back(1.0 + static_cast<double>(job.bytes));
        total_ += bytes_.back();
    }
    std::iota(order_.begin(), order_.end(), size_t{0});
    std::stable_sort(order_.begin(), order_.end(), [&](size_t a, size_t b) { return bytes_[a] > bytes_[b]; });
}

void Bakery::report(size_t job, double share)
{
    const std::lock_guard lock(reporting_);
    done_ += (share - shares_[job]) * bytes_[job];
    shares_[job] = share;
    progress_.update(static_cast<size_t>(1000 * done_ / total_), 1000);
}

BakeFileReport Bakery::bakeOne(size_t job, unsigned threads)
{
    FileBakeOptions options = options_.bake;
    options.bake.threads = threads;
    options.bake.cancelled = Interruptible::interrupted;
    options.bake.progress = [&](size_t done, size_t total) {
        report(job, total == 0 ? 0 : static_cast<double>(done) / static_cast<double>(total));
    };
    bool noted = false;
    const auto failed = [&](const std::string &error) {
        if (!noted)
            exclusions_.noteUnread();
        BakeFileReport report;
        report.job = jobs_[job];
        report.error = error;
        report.code = ExitCode::Failed;
        return report;
    };
    const std::string prefix = utf8Text(jobs_[job].input) + ": ";
    const auto notBaked = [&](const std::string &reason) {
        BakeFileReport report = failed(prefix + "not baked: " + reason);
        report.ended = false;
        return report;
    };
    if (Interruptible::interrupted())
        return notBaked("interrupted");
    if (!jobs_[job].problem.empty())
        return failed(prefix + jobs_[job].problem);
    if (!options.sink && !options.dryRun)
        if (const std::string problem = storage_.problemOf(jobs_[job]); !problem.empty())
            return notBaked(problem);
    options.measure = true;
    options.replaceCopies = options_.force;
    if (jobs_.size() > 1)
        options.images = &images_;
    try {
        const Document document = openDocument(jobs_[job].input);
        exclusions_.note(document);
        noted = true;
        BakeFileReport report = reportOf(jobs_[job], bakeFile(document, jobs_[job].output, options));
        if (options.requireMicromaps && report.primitives.empty() && report.failure.empty()) {
            report.failure = prefix + "nothing was written: no primitive gets a micromap" + skippedText(report);
            report.code = ExitCode::NoMicromaps;
        }
        return report;
    } catch (const BakeCancelled &) {
        return notBaked("interrupted");
    } catch (const std::bad_alloc &) {
        return failed(prefix + "out of memory");
    } catch (const GltfStorageError &error) {
        storage_.fail(jobs_[job], error, std::string(error.what()).substr(prefix.size()));
        return failed(error.what());
    } catch (const GltfError &error) {
        return failed(error.what());
    } catch (const std::exception &error) {
        return failed(prefix + error.what());
    }
}

void Bakery::bakeNext(size_t i)
{
    const size_t left = order_.size() - i;
    const unsigned threads = left >= threads_ ? 1 : threads_ / static_cast<unsigned>(left);
    const size_t job = order_[i];
    const auto begin = std::chrono::steady_clock::now();
    result_.reports[job] = bakeOne(job, threads);
    const auto passed = std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now() - begin);
    log(result_.reports[job], static_cast<uint64_t>(passed.count()));
    report(job, 1);
}

void Bakery::log(const BakeFileReport &report, uint64_t milliseconds)
{
    if (log_ == nullptr || !report.ended)
        return;
    const char *status = report.code != ExitCode::Success ? job::kFailed
                         : !report.primitives.empty()     ? job::kBaked
                         : report.replaced                ? job::kRemoved
                                                          : job::kUnchanged;
    try {
        log_->add({report.job.input, report.job.output, status, digest_, report.inputBytes, report.files, milliseconds,
                   report.error.empty() ? report.failure : report.error});
    } catch (const Error &error) {
        const std::lock_guard lock(reporting_);
        result_.logError = error.what();
    }
}

BakeRun Bakery::run()
{
    inParallel(threads_, jobs_.size(), [this](size_t i) { bakeNext(i); });
    result_.stopped = storage_.firstProblem();
    return std::move(result_);
}

BakeRun bakeAll(const BakeCommandOptions &options, UnmatchedExclusions &exclusions)
{
    BakePlan plan = planBake(options);
    std::optional<job::Log> log;
    if (options.log)
        log.emplace(*options.log);
    // Other files may have a match.
    if (options.shard || plan.done != 0)
        exclusions.noteUnread();
    const Interruptible interruptible;
    BakeRun run = Bakery(options, std::move(plan.jobs), exclusions, log ? &*log : nullptr).run();
    run.done = plan.done;
    return run;
}

// With the rules of files that failed: an earlier output of theirs stays, and is out of date. Throws Error.
void writeDepfile(const fs::path &path, const std::vector<BakeFileReport> &reports)
{
    std::string text;
    for (const BakeFileReport &report : reports)
        text += ruleOf(report.job);
    writeWhole(path, text);
}

// Prints errors and problems to stderr, a line each.
ExitCode printProblems(const std::vector<BakeFileReport> &reports)
{
    auto code = ExitCode::Success;
    for (const BakeFileReport &report : reports) {
        code = worse(code, report.code);
        for (const std::string &problem : {report.error, report.failure})
            if (!problem.empty())
                std::fprintf(stderr, "vellum: %s\n", problem.c_str());
    }
    return code;
}

} // namespace

int bakeCommand(BakeCommandOptions &options)
{
    std::optional<DataOutput> data;
    options.bake.dryRun = options.dryRun;
    options.bake.mark = options.output != "-";
    if (options.output == "-") {
        data.emplace(DataOutput::Reports::ToStderr);
        options.bake.embed = true;
        options.bake.sink = [&data](const FileContent &content) {
            for (const std::span<const uint8_t> piece : content.pieces())
                data->write(piece);
            data->finish();
        };
    }
    options.bake.skipUnchanged = !options.copy && options.output != "-";
    if (options.quiet && !options.json)
        discardReports();
    std::optional<CacheFolder> cache;
    if (!options.cache.empty()) {
        cache.emplace(options.cache, options.cacheSize);
        options.bake.cache.get = [&cache](const Digest &key) { return cache->get(key); };
        if (!options.dryRun)
            options.bake.cache.put = [&cache](const Digest &key, std::span<const uint8_t> value) {
                cache->put(key, value);
            };
    }
    UnmatchedExclusions exclusions(options.bake);
    const BakeRun run = bakeAll(options, exclusions);
    const std::vector<BakeFileReport> &reports = run.reports;
    if (options.json)
        printJson(reports, run.done, options.dryRun);
    else if (options.table)
        printTable(reports);
    else
        printLines(reports);
    if (!options.json && run.done != 0)
        std::printf("%s done before\n", counted(run.done, "file was", "files were").c_str());
    if (!options.json && run.done == 0 && reports.empty())
        std::printf("no file is in this shard\n");
    if (options.dryRun && !options.json)
        std::printf("nothing was written (--dry-run)\n");
    if (const std::string text = totals(reports); !text.empty() && !options.json)
        std::printf("%s\n", text.c_str());
    std::fflush(stdout);
    ExitCode code = printProblems(reports);
    if (cache && !cache->problem().empty())
        std::fprintf(stderr, "vellum: warning: the cache cannot be used as it should: %s\n", cache->problem().c_str());
    if (options.depfile)
        writeDepfile(*options.depfile, reports);
    if (!run.logError.empty()) {
        std::fprintf(stderr, "vellum: %s\n", run.logError.c_str());
        code = worse(code, ExitCode::Failed);
    }
    const auto baked = std::count_if(reports.begin(), reports.end(),
                                     [](const BakeFileReport &report) { return report.error.empty(); });
    const auto printStop = [&](const std::string &reason) {
        std::fprintf(stderr, "vellum: %s: %zu of %zu files were baked\n", reason.c_str(), static_cast<size_t>(baked),
                     reports.size());
    };
    if (Interruptible::interrupted()) {
        printStop("interrupted");
        Interruptible::die();
    }
    if (reports.size() > 1 &&
        std::any_of(reports.begin(), reports.end(), [](const BakeFileReport &report) { return !report.ended; }))
        printStop("stopped: " + run.stopped);
    exclusions.print();
    return static_cast<int>(code);
}

} // namespace vellum::cli
