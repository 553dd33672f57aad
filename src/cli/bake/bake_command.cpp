// SPDX-License-Identifier: Apache-2.0
#include "cli/bake/bake.h"

#include <algorithm>
#include <cstdio>
#include <mutex>
#include <numeric>
#include <optional>
#include <thread>

#include "base/error.h"
#include "base/process.h"
#include "base/progress.h"
#include "base/text.h"
#include "cli/bake/bake_report.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "core/parallel.h"
#include "core/utf8_path.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kNotBaked = "not baked: interrupted";

// Bakes files on several threads: many files at a time, and the last ones with several threads each.
class Bakery
{
public:
    Bakery(const BakeCommandOptions &options, std::vector<BakeJob> jobs, UnmatchedExclusions &exclusions);
    std::vector<BakeFileReport> run();

private:
    void bakeNext(size_t i);
    BakeFileReport bakeOne(size_t job, unsigned threads);
    void report(size_t job, double share);

    const BakeCommandOptions &options_;
    UnmatchedExclusions &exclusions_;
    std::vector<BakeJob> jobs_;
    std::vector<BakeFileReport> reports_;
    std::vector<double> bytes_; // of the inputs
    std::vector<size_t> order_; // the largest first
    unsigned threads_;
    std::mutex reporting_;
    ProgressLine progress_;
    double total_ = 0;
    double done_ = 0;
    std::vector<double> shares_; // of each file, done
};

Bakery::Bakery(const BakeCommandOptions &options, std::vector<BakeJob> jobs, UnmatchedExclusions &exclusions)
    : options_(options), exclusions_(exclusions), jobs_(std::move(jobs)), reports_(jobs_.size()), order_(jobs_.size()),
      threads_(options.threads != 0 ? options.threads : std::max(1u, std::thread::hardware_concurrency())),
      progress_("baking"), shares_(jobs_.size())
{
    for (const BakeJob &job : jobs_) {
        std::error_code error;
        const auto bytes = std::filesystem::file_size(job.input, error);
        bytes_.push_back(error ? 1.0 : 1.0 + static_cast<double>(bytes));
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
        return report;
    };
    const std::string prefix = utf8Text(jobs_[job].input) + ": ";
    if (Interruptible::interrupted())
        return failed(prefix + kNotBaked);
    if (!jobs_[job].problem.empty())
        return failed(prefix + jobs_[job].problem);
    options.measure = true;
    try {
        const Document document = openDocument(jobs_[job].input);
        exclusions_.note(document);
        noted = true;
        return reportOf(jobs_[job], bakeFile(document, jobs_[job].output, options));
    } catch (const BakeCancelled &) {
        return failed(prefix + kNotBaked);
    } catch (const std::bad_alloc &) {
        return failed(prefix + "out of memory");
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
    reports_[job] = bakeOne(job, threads);
    report(job, 1);
}

std::vector<BakeFileReport> Bakery::run()
{
    struct NoState {
    };
    inParallel<NoState>(threads_, jobs_.size(), [this](size_t i, NoState &) { bakeNext(i); });
    return std::move(reports_);
}

std::vector<BakeFileReport> bakeAll(const BakeCommandOptions &options, UnmatchedExclusions &exclusions)
{
    std::vector<BakeJob> jobs = planBake(options);
    const Interruptible interruptible;
    return Bakery(options, std::move(jobs), exclusions).run();
}

// Prints errors and problems to stderr, a line each.
ExitCode printProblems(const BakeCommandOptions &options, const std::vector<BakeFileReport> &reports)
{
    auto code = ExitCode::Success;
    for (const BakeFileReport &report : reports) {
        for (const std::string &problem : {report.error, report.failure}) {
            if (problem.empty())
                continue;
            std::fprintf(stderr, "vellum: %s\n", problem.c_str());
            code = worse(code, ExitCode::Failed);
        }
        if (!options.bake.requireMicromaps || !report.error.empty() || !report.primitives.empty())
            continue;
        if (report.failure.empty())
            std::fprintf(stderr, "vellum: %s: nothing was written: no primitive gets a micromap%s\n",
                         utf8Text(report.job.input).c_str(), skippedText(report).c_str());
        code = worse(code, ExitCode::NoMicromaps);
    }
    return code;
}

} // namespace

int bakeCommand(BakeCommandOptions &options)
{
    std::optional<DataOutput> data;
    if (options.dryRun) {
        options.bake.sink = [](const FileContent &) {};
    } else if (options.output == "-") {
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
    UnmatchedExclusions exclusions(options.bake);
    const std::vector<BakeFileReport> reports = bakeAll(options, exclusions);
    if (options.json)
        printJson(reports, options.dryRun);
    else if (options.table)
        printTable(reports);
    else
        printLines(reports);
    if (options.dryRun && !options.json)
        std::printf("nothing was written (--dry-run)\n");
    const auto unchanged = std::count_if(reports.begin(), reports.end(), [](const BakeFileReport &report) {
        return report.error.empty() && !report.written;
    });
    if (unchanged != 0 && !options.bake.requireMicromaps && !options.json)
        std::printf("%s not written, as nothing is baked; --copy writes copies of such inputs\n",
                    counted(static_cast<size_t>(unchanged), "output was", "outputs were").c_str());
    std::fflush(stdout);
    const ExitCode code = printProblems(options, reports);
    if (!Interruptible::interrupted()) {
        exclusions.print();
        return static_cast<int>(code);
    }
    const auto baked = std::count_if(reports.begin(), reports.end(),
                                     [](const BakeFileReport &report) { return report.error.empty(); });
    std::fprintf(stderr, "vellum: interrupted: %zu of %zu files were baked\n", static_cast<size_t>(baked),
                 reports.size());
    Interruptible::die();
}

} // namespace vellum::cli
