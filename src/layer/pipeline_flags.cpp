#include "layer/pipeline_flags.h"

namespace vellum::layer
{

const void *driverChain(const void *pNext, std::deque<Chain> &chains)
{
    const auto *flags2 =
        findInChain<newer::PipelineCreateFlags2CreateInfo>(pNext, newer::kPipelineCreateFlags2CreateInfo);
    if (!flags2 || (flags2->flags & kMicromapPipelineFlags) == 0)
        return pNext;
    Chain &chain = chains.emplace_back(pNext);
    if (auto *edited = chain.edit<newer::PipelineCreateFlags2CreateInfo>(newer::kPipelineCreateFlags2CreateInfo))
        edited->flags &= ~kMicromapPipelineFlags;
    return chain.head();
}

} // namespace vellum::layer
