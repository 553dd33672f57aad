// SPDX-License-Identifier: Apache-2.0
#include "cli/check/output_folder.h"

#include "cli/base/error.h"
#include "cli/base/output_file.h"
#include "core/utf8_path.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kResults = "results.json";
constexpr const char *kFailures = "failures";

} // namespace

void writeText(const std::filesystem::path &path, const std::string &text)
{
    writeWhole(path, {reinterpret_cast<const uint8_t *>(text.data()), text.size()});
}

OutputFolder::OutputFolder(std::filesystem::path path, bool force) : path_(std::move(path))
{
    std::error_code error;
    if (std::filesystem::exists(path_, error) && !std::filesystem::is_directory(path_, error))
        throw Error(utf8Text(path_) + " cannot be written: it is not a directory");
    const bool foreign = std::filesystem::is_directory(path_, error) && !std::filesystem::is_empty(path_, error) &&
                         !std::filesystem::exists(path_ / kResults, error);
    if (foreign && !force)
        throw Error(utf8Text(path_) + " has files that vellum check did not write; --force writes into it");
    std::filesystem::create_directories(path_ / kFailures, error);
    if (error)
        throw Error(utf8Text(path_) + " cannot be written: " + error.message());
}

std::string OutputFolder::writeFailure(const Finished &finished, uint64_t seed)
{
    if (++written_[causeOf(finished.outcome)] > kMostReproducers)
        return {};
    const std::string name = nameOf(finished.id);
    const std::filesystem::path path = path_ / kFailures / (name + ".json");
    // What is larger is not shrunk: the seed makes it.
    const std::string &shrunk = finished.outcome.reproducer;
    writeText(path, write(Reproducer{name, finished.id.api, std::string(finished.id.group->name), seed,
                                     shrunk.size() <= kMostReproducerBytes ? shrunk : std::string()}));
    for (const check::OutcomeFile &file : finished.outcome.files)
        writeText(path_ / kFailures / (name + "." + file.extension), file.bytes);
    return utf8Text(path);
}

void OutputFolder::writeResults(const RunFacts &facts, const std::vector<CaseResult> &results) const
{
    writeText(path_ / "results.csv", resultsCsv(results));
    writeText(path_ / "failures.csv", failuresCsv(results));
    writeText(path_ / "junit.xml", junitXml(facts, results));
    writeText(path_ / kResults, resultsJson(facts, results));
}

} // namespace vellum::cli
