// SPDX-License-Identifier: Apache-2.0
#include "layer/state/micromap_warnings.h"

#include <algorithm>

namespace vellum::layer
{

void MicromapWarnings::warn(const char *id, const std::string &text)
{
    {
        std::lock_guard lock(mutex_);
        // If EXT is the driver's, the application uses its micromaps without the layer.
        if (!used_ && !(driver_.translated() && driver_.enabled.ext)) {
            // One more than the limit is enough for the message about the limit.
            const uint32_t limit = driver_.settings->messageLimit;
            const auto isSame = [id](const auto &kept) { return kept.first == id; };
            if (limit == 0 || std::ranges::count_if(kept_, isSame) <= std::ptrdiff_t{limit})
                kept_.emplace_back(id, text);
            return;
        }
    }
    driver_.report().warning(id, text);
}

void MicromapWarnings::micromapsAreUsed()
{
    if (used_.load(std::memory_order_relaxed))
        return;
    std::vector<std::pair<const char *, std::string>> kept;
    {
        std::lock_guard lock(mutex_);
        used_ = true;
        kept.swap(kept_);
    }
    for (const auto &[id, text] : kept)
        driver_.report().warning(id, text);
}

} // namespace vellum::layer
