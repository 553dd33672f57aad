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
    FileReport bakeOne(std::size_t job, unsigned threads);
    void tell(std::size_t job, double share);

    const BakeCommandOptions &m_options;
    std::vector<BakeJob> m_jobs;
    std::vector<FileReport> m_reports;
    std::vector<double> m_bytes;      // of the inputs
    std::vector<std::size_t> m_order; // the largest first
    unsigned m_threads;
    std::atomic<std::size_t> m_next{0};
    std::mutex m_telling;
    Progress m_progress;
    double m_total = 0;
    double m_done = 0;
    std::vector<double> m_shares; // of each file that are done
};

Bakery::Bakery(const BakeCommandOptions &options, std::vector<BakeJob> jobs)
    : m_options(options), m_jobs(std::move(jobs)), m_reports(m_jobs.size()), m_order(m_jobs.size()),
      m_threads(options.threads != 0 ? options.threads : std::max(1u, std::thread::hardware_concurrency())),
      m_progress("baking"), m_shares(m_jobs.size())
{
    for (const BakeJob &job : m_jobs) {
        std::error_code error;
        const auto bytes = std::filesystem::file_size(job.input, error);
        m_bytes.push_back(error ? 1.0 : 1.0 + static_cast<double>(bytes));
        m_total += m_bytes.back();
    }
    std::iota(m_order.begin(), m_order.end(), std::size_t{0});
    std::stable_sort(m_order.begin(), m_order.end(),
                     [&](std::size_t a, std::size_t b) { return m_bytes[a] > m_bytes[b]; });
}

void Bakery::tell(std::size_t job, double share)
{
    const std::lock_guard lock(m_telling);
    m_done += (share - m_shares[job]) * m_bytes[job];
    m_shares[job] = share;
    m_progress.update(static_cast<std::size_t>(1000 * m_done / m_total), 1000);
}

FileReport Bakery::bakeOne(std::size_t job, unsigned threads)
{
    FileBakeOptions options = m_options.bake;
    options.bake.threads = threads;
    options.bake.cancelled = Interruptible::interrupted;
    options.bake.progress = [&](std::size_t done, std::size_t total) {
        tell(job, total == 0 ? 0 : static_cast<double>(done) / static_cast<double>(total));
    };
    const auto failed = [&](const std::string &error) {
        FileReport report;
        report.job = m_jobs[job];
        report.error = error;
        return report;
    };
    const std::string prefix = m_jobs[job].input.string() + ": ";
    if (!m_jobs[job].refusal.empty())
        return failed(prefix + m_jobs[job].refusal);
    options.measure = true;
    try {
        return reportOf(m_jobs[job], bakeFile(m_jobs[job].input, m_jobs[job].output, options));
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
    for (std::size_t i = m_next++; i < m_order.size() && !Interruptible::interrupted(); i = m_next++) {
        const std::size_t left = m_order.size() - i;
        const unsigned threads = left >= m_threads ? 1 : m_threads / static_cast<unsigned>(left);
        const std::size_t job = m_order[i];
        m_reports[job] = bakeOne(job, threads);
        tell(job, 1);
    }
}

std::vector<FileReport> Bakery::run()
{
    std::vector<std::thread> workers;
    for (std::size_t i = 1; i < std::min<std::size_t>(m_threads, m_jobs.size()); ++i)
        workers.emplace_back([this] { work(); });
    work();
    for (std::thread &worker : workers)
        worker.join();
    return std::move(m_reports);
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
