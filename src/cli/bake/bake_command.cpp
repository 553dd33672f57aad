// SPDX-License-Identifier: Apache-2.0
#include "cli/bake/bake.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <mutex>
#include <numeric>
#include <optional>

#include "base/error.h"
#include "base/files.h"
#include "base/process.h"
#include "base/progress.h"
#include "base/text.h"
#include "cli/bake/bake_report.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "core/parallel.h"
#include "core/utf8_path.h"
#include "gltf/file/cache_folder.h"
#include "gltf/file/gltf_error.h"
#include "job/log.h"

namespace vellum::cli
{
namespace
{

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
