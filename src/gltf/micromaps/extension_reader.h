// SPDX-License-Identifier: Apache-2.0
// Reads the extension and collects whatever breaks a rule on the way.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gltf/document.h"
#include "gltf/file/json_tree.h"
#include "gltf/micromaps/stored_micromaps.h"

namespace vellum
{

class ExtensionReader
{
public:
    // Stops at `most` findings.
    ExtensionReader(const Document &document, size_t most);

    // Implements lossOfMicromaps().
    [[nodiscard]] std::optional<std::string> loss() const;
    // Reads the micromaps that are whole, and leaves the others empty.
    StoredMicromaps read();
    [[nodiscard]] std::vector<MicromapFinding> takeFindings() { return std::move(findings_); }

private:
    // Thrown at the first finding of an element or a primitive after which the rest of it has no meaning.
    struct Broken {
    };

    void note(const std::string &message);
    [[noreturn]] void fail(const std::string &message);
    [[nodiscard]] bool full() const { return findings_.size() >= most_; }
    template <typename Read>
    void at(std::string place, Read &&read);

    void findExtension();
    void readMicromap(const JsonValue &element, StoredMicromap &micromap);
    void readUsage(const JsonValue &element, StoredMicromap &micromap);
    void readRecords(const JsonValue &element, StoredMicromap &micromap);
    void checkRecords(const StoredMicromap &micromap);
    void checkOverlap(const StoredMicromap &micromap);
    void checkUsage(const StoredMicromap &micromap);
    void readMesh(uint32_t mesh, const JsonValue &value);
    void readPrimitive(PrimitivePlace place, const JsonValue &extension);
    uint64_t triangleCount(PrimitivePlace place);
    std::vector<int32_t> readIndices(int64_t accessor, uint64_t triangles);
    void checkIndices(const PrimitiveMicromap &primitive, size_t records);

    int64_t required(const JsonValue &object, const char *name);
    std::vector<int64_t> requiredList(const JsonValue &object, const char *name);
    std::span<const uint8_t> view(int64_t index, const char *name);
    // Many elements may name one buffer view: what is copied out of the file is bounded.
    void account(size_t bytes);

    const Document &document_;
    JsonValue root_;
    size_t most_;
    std::string place_;
    std::vector<MicromapFinding> findings_;
    uint64_t allowance_;
    StoredMicromaps stored_;
    std::vector<bool> whole_; // by micromap
};

} // namespace vellum
