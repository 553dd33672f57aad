// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/output_files.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <random>

#include "bake/bake.h"
#include "core/utf8_path.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{
std::filesystem::path folderOf(const std::filesystem::path &path)
{
    return path.has_parent_path() ? path.parent_path() : ".";
}

std::filesystem::path temporaryName(const std::filesystem::path &path,
                                    const std::function<bool(const std::filesystem::path &)> &create)
{
    constexpr int kTries = 100;
    std::random_device random;
    std::filesystem::path name;
    for (int i = 0; i < kTries; ++i) {
        std::array<char, 18> digits{};
        std::snprintf(digits.data(), digits.size(), ".%08x%08x", static_cast<unsigned>(random()),
                      static_cast<unsigned>(random()));
        name = ".";
        name += path.filename().native().substr(0, 200);
        name += digits.data();
        name += ".tmp";
        name = folderOf(path) / name;
        if (create(name))
            break;
    }
    return name;
}

bool sameBytes(const std::filesystem::path &a, const std::filesystem::path &b)
{
    std::error_code error;
    if (std::filesystem::equivalent(a, b, error))
        return true;
    try {
        InputFile one(a);
        InputFile other(b);
        if (one.size() != other.size())
            return false;
        std::vector<uint8_t> first(size_t{1} << 16);
        std::vector<uint8_t> second(first.size());
        while (const size_t count = one.read(first))
            if (other.read(std::span(second).first(count)) != count ||
                !std::equal(first.begin(), first.begin() + static_cast<ptrdiff_t>(count), second.begin()))
                return false;
        return true;
    } catch (const GltfError &) {
        return false;
    }
}

uint64_t FileContent::size() const
{
    uint64_t size = 0;
    for (const auto &piece : pieces_)
        size += piece.size();
    return size;
}

OutputFiles::~OutputFiles()
{
    pending_.clear();
    std::error_code ignored; // a folder may have got other files since
    if (!published_)
        for (auto folder = folders_.rbegin(); folder != folders_.rend(); ++folder)
            std::filesystem::remove(*folder, ignored);
}

void OutputFiles::makeFolders(const std::filesystem::path &folder)
{
    std::error_code error;
    if (std::filesystem::is_directory(folder, error))
        return;
    if (folder.has_parent_path() && folder.parent_path() != folder)
        makeFolders(folder.parent_path());
    if (makeFolder(folder))
        folders_.push_back(folder);
}

NewFile &OutputFiles::open(const std::filesystem::path &path, Existing existing)
{
    std::error_code error;
    // Devices must not be replaced either.
    if (std::filesystem::exists(path, error) && !std::filesystem::is_regular_file(path, error))
        throw GltfError(utf8Text(path) + ": cannot be written: it is there already and is not a file");
    makeFolders(folderOf(path));
    return pending_.emplace_back(path, existing).file;
}

void OutputFiles::put(NewFile &file, std::span<const uint8_t> bytes) const
{
    constexpr size_t kAtOnce = size_t{4} << 20;
    while (!bytes.empty()) {
        if (cancelled_ && cancelled_())
            throw BakeCancelled();
        const size_t count = std::min(bytes.size(), kAtOnce);
        file.write(bytes.first(count));
        bytes = bytes.subspan(count);
    }
}

void OutputFiles::write(const std::filesystem::path &path, const FileContent &content)
{
    write(path, content, Existing::Replace);
}

void OutputFiles::writeOnce(const std::filesystem::path &path, const FileContent &content)
{
    write(path, content, Existing::Keep);
}

void OutputFiles::write(const std::filesystem::path &path, const FileContent &content, Existing existing)
{
    NewFile &file = open(path, existing);
    for (const auto &piece : content.pieces())
        put(file, piece);
    file.finish();
}

void OutputFiles::copy(const std::filesystem::path &from, const std::filesystem::path &to,
                       const std::filesystem::path &model, bool replace)
{
    const auto reading = [&](auto &&read) {
        try {
            return read();
        } catch (const GltfError &error) {
            throw GltfError(utf8Text(from) + ": " + error.what());
        }
    };
    std::optional<InputFile> source;
    reading([&] {
        source.emplace(from);
        source->requireBeside(model);
    });
    std::error_code error;
    if (std::filesystem::exists(to, error)) {
        if (sameBytes(from, to))
            return;
        if (!replace)
            throw GltfError(utf8Text(to) + ": is there already and differs from " + utf8Text(from));
    }
    NewFile &file = open(to, replace ? Existing::Replace : Existing::Keep);
    std::vector<uint8_t> bytes(size_t{1} << 20);
    while (const size_t count = reading([&] { return source->read(bytes); }))
        put(file, std::span(bytes).first(count));
    file.finish();
}

void OutputFiles::publish(Pending &pending)
{
    const NewFile::Appeared appeared = pending.file.appear();
    if (appeared == NewFile::Appeared::No && pending.existing == Existing::Replace)
        pending.file.replace();
    // Something else was quicker, another file of this run perhaps.
    if (appeared == NewFile::Appeared::No && pending.existing == Existing::Keep &&
        !sameBytes(pending.file.readable(), pending.file.path()))
        throw GltfError(utf8Text(pending.file.path()) + ": is there already and is different");
}

void OutputFiles::publish()
{
    for (Pending &pending : pending_)
        publish(pending);
    published_ = true;
    for (const Pending &pending : pending_)
        pending.file.syncName();
    pending_.clear();
}

} // namespace vellum
