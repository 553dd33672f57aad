// SPDX-License-Identifier: Apache-2.0
#include "base/files.h"

#include "base/error.h"
#include "base/progress.h"

namespace vellum
{

std::filesystem::path locationOf(const std::filesystem::path &path)
{
    std::error_code error;
    const std::filesystem::path whole = std::filesystem::absolute(path).lexically_normal();
    const std::filesystem::path folder = std::filesystem::weakly_canonical(whole.parent_path(), error);
    return error ? whole : folder / whole.filename();
}

void discardReports()
{
    ProgressLine::disable();
    if (!discardStdout())
        throw Error("stdout cannot be closed");
}

DataOutput::DataOutput(Reports reports) : file_(nullptr, &std::fclose)
{
    std::fflush(stdout);
    file_.reset(duplicateStdout());
    if (file_ == nullptr)
        throw Error("stdout cannot be written");
    if (reports == Reports::Discarded)
        discardReports();
    else if (!sendStdoutToStderr())
        throw Error("stdout cannot be written");
}

void DataOutput::write(std::span<const uint8_t> bytes)
{
    if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size())
        throw Error("stdout cannot be written");
}

void DataOutput::finish()
{
    if (std::fflush(file_.get()) != 0)
        throw Error("stdout cannot be written");
}

} // namespace vellum
