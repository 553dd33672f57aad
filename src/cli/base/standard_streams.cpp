// SPDX-License-Identifier: Apache-2.0
#include "cli/base/standard_streams.h"

#include "cli/base/error.h"
#include "cli/base/output_file.h"
#include "cli/base/progress.h"
#include "cli/base/system/streams.h"

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
