// SPDX-License-Identifier: Apache-2.0
#include "cli/base/standard_streams.h"

#include <unistd.h>

#include "cli/base/error.h"
#include "cli/base/output_file.h"
#include "cli/base/progress.h"

namespace vellum::cli
{

std::vector<uint8_t> readStdin()
{
    constexpr size_t kMostBytes = size_t{1} << 31;
    constexpr size_t kBlock = size_t{1} << 20;
    std::vector<uint8_t> bytes;
    size_t count = 1;
    while (count != 0) {
        const size_t before = bytes.size();
        bytes.resize(before + kBlock);
        count = std::fread(bytes.data() + before, 1, kBlock, stdin);
        bytes.resize(before + count);
        if (bytes.size() > kMostBytes)
            throw GltfError("-: stdin has more than 2 GiB");
    }
    if (std::ferror(stdin) != 0)
        throw GltfError("-: stdin cannot be read");
    return bytes;
}

Document openDocument(const std::filesystem::path &path)
{
    return isStandardStream(path) ? Document(path, readStdin()) : Document(path);
}

void discardReports()
{
    Progress::disable();
    if (std::freopen("/dev/null", "w", stdout) == nullptr)
        throw Error("/dev/null cannot be opened");
}

DataOutput::DataOutput(Reports reports) : file_(nullptr, &std::fclose)
{
    std::fflush(stdout);
    if (const int copy = dup(STDOUT_FILENO); copy >= 0)
        file_.reset(fdopen(copy, "wb"));
    if (file_ == nullptr)
        throw Error("stdout cannot be written");
    if (reports == Reports::Discarded)
        discardReports();
    else if (dup2(STDERR_FILENO, STDOUT_FILENO) < 0)
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

void writeData(const std::filesystem::path &path, std::span<const uint8_t> bytes, std::optional<DataOutput> &data)
{
    if (!isStandardStream(path)) {
        writeWhole(path, bytes);
        return;
    }
    data->write(bytes);
    data->finish();
}

} // namespace vellum::cli
