// SPDX-License-Identifier: Apache-2.0
// WebAssembly has no files: what a document names is in memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>

namespace vellum
{

// The files that can be opened as long as this object exists, instead of those of an earlier one.
class MemoryFiles
{
public:
    MemoryFiles() : outer_(current_) { current_ = this; }
    ~MemoryFiles() { current_ = outer_; }
    MemoryFiles(const MemoryFiles &) = delete;
    MemoryFiles &operator=(const MemoryFiles &) = delete;

    // The bytes must stay.
    void add(const std::filesystem::path &path, std::span<const uint8_t> bytes)
    {
        files_[path.lexically_normal()] = bytes;
    }
    // Null if there is no file of that path.
    static const std::span<const uint8_t> *find(const std::filesystem::path &path)
    {
        if (current_ == nullptr)
            return nullptr;
        const auto found = current_->files_.find(path.lexically_normal());
        return found == current_->files_.end() ? nullptr : &found->second;
    }

private:
    inline static MemoryFiles *current_ = nullptr;
    MemoryFiles *outer_;
    std::map<std::filesystem::path, std::span<const uint8_t>> files_;
};

} // namespace vellum
