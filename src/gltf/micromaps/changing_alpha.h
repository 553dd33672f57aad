// SPDX-License-Identifier: Apache-2.0
// Primitives whose alpha is not what the base colour texture of their material says, or not always.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "gltf/document.h"

namespace vellum
{

class ChangingAlpha
{
public:
    explicit ChangingAlpha(const Document &document);

    // Why a micromap could be wrong for a primitive; none if it cannot.
    [[nodiscard]] std::optional<std::string> reason(PrimitivePlace place) const;

private:
    const Document &document_;
    std::map<int, std::string> materials_; // reasons
};

} // namespace vellum
