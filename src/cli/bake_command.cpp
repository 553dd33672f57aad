#include "cli/bake_command.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <mutex>
#include <numeric>
#include <thread>

#include "cli/bake_report.h"
#include "cli/base/error.h"
#include "cli/base/interrupt.h"
#include "cli/base/progress.h"

namespace vellum::cli
{
namespace
{

// Bakes files on several threads: many files beside each other, and the last ones with several threads each.
class Bakery
{
public:
    Bakery(const BakeCommandOptions &options, std::vector<BakeJob> jobs);
    std::vector<FileReport> run();

private:
    void work();
    FileReport bakeOne(size_t job, unsigned threads);
    void tell(size_t job, double share);

    const BakeCommandOptions &options_;
    std::vector<BakeJob> jobs_;
    std::vector<FileReport> reports_;
    std::vector<double> bytes_; // of the inputs
    std::vector<size_t> order_; // the largest first
    unsigned threads_;
    std::atomic<size_t> next_{0};
    std::mutex telling_;
    Progress progress_;
    double total_ = 0;
    double done_ = 0;
    std::vector<double> shares_; // of each file that are done
};

Bakery::Bakery(const BakeCommandOptions &options, std::vector<BakeJob> jobs)
    : options_(options), jobs_(std::move(jobs)), reports_(jobs_.size()), order_(jobs_.size()),
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

void Bakery::tell(size_t job, double share)
{
    const std::lock_guard lock(telling_);
    done_ += (share - shares_[job]) * bytes_[job];
    shares_[job] = share;
    progress_.update(static_cast<size_t>(1000 * done_ / total_), 1000);
}

FileReport Bakery::bakeOne(size_t job, unsigned threads)
{
    FileBakeOptions options = options_.bake;
    options.bake.threads = threads;
    options.bake.cancelled = Interruptible::interrupted;
    options.bake.progress = [&](size_t done, size_t total) {
        tell(job, total == 0 ? 0 : static_cast<double>(done) / static_cast<double>(total));
    };
    const auto failed = [&](const std::string &error) {
        FileReport report;
        report.job = jobs_[job];
        report.error = error;
        return report;
    };
    const std::string prefix = jobs_[job].input.string() + ": ";
    if (!jobs_[job].refusal.empty())
        return failed(prefix + jobs_[job].refusal);
    options.measure = true;
    try {
        return reportOf(jobs_[job], bakeFile(jobs_[job].input, jobs_[job].output, options));
    } catch (const std::bad_alloc &) {
        return failed(prefix + "out of memory");
    } catch (const GltfError &error) {
        return failed(error.what());
    } catch (const std::exception &error) {
        return failed(prefix + error.what());
    }
}

void Bakery::work()
{
    for (size_t i = next_++; i < order_.size() && !Interruptible::interrupted(); i = next_++) {
        const size_t left = order_.size() - i;
        const unsigned threads = left >= threads_ ? 1 : threads_ / static_cast<unsigned>(left);
        const size_t job = order_[i];
        reports_[job] = bakeOne(job, threads);
        tell(job, 1);
    }
}

std::vector<FileReport> Bakery::run()
{
    std::vector<std::thread> workers;
    for (size_t i = 1; i < std::min<size_t>(threads_, jobs_.size()); ++i)
        workers.emplace_back([this] { work(); });
    work();
    for (std::thread &worker : workers)
        worker.join();
    return std::move(reports_);
}

} // namespace

int bakeCommand(const BakeCommandOptions &options)
{
    std::vector<BakeJob> jobs = planBake(options);
    std::vector<FileReport> reports;
    {
        const Interruptible interruptible;
        reports = Bakery(options, std::move(jobs)).run();
        if (Interruptible::interrupted()) {
            std::fprintf(stderr, "vellum: interrupted\n");
            Interruptible::die();
        }
    }
    if (options.json)
        printJson(reports);
    else if (options.report)
        printTable(reports);
    else
        printLines(reports);
    std::fflush(stdout);
    int code = 0;
    for (const FileReport &report : reports) {
        for (const std::string &problem : {report.error, report.failure}) {
            if (problem.empty())
                continue;
            std::fprintf(stderr, "vellum: %s\n", problem.c_str());
            code = 1;
        }
    }
    return code;
}

} // namespace vellum::cli
