// Whether the driver carries unused ray flag bits through a ray query and through traceRay (spirv/rewrite.h can use
// three). Found out by tracing one ray, when the first shader depends on it; never by the driver's name.
#pragma once

#include <array>
#include <atomic>
#include <mutex>
#include <optional>

#include "layer/ground/driver.h"

namespace vellum::layer
{

struct DevicePipelines;

// The answers are true where the bits come back and change no hit; also where the application did not enable that way
// of tracing, or has no queue that could trace, so that nothing depends on it. They are false where the driver could
// not be tried, and with the setting carried_ray_flags off. A device gives one answer for good: shaders of several
// libraries must agree on how flags reach them. Any thread may ask.
class RayFlagBits
{
public:
    explicit RayFlagBits(DevicePipelines &device) : device_(device) {}
    bool inQueries() { return carried(Way::Query); }
    bool inPipelines() { return carried(Way::Pipeline); }

private:
    enum class Way { Query, Pipeline };
    bool carried(Way way);
    std::optional<bool> tryOut(Way way);

    struct Answer {
        std::atomic<TriedOut> carried = TriedOut::No;
        std::mutex mutex; // held while a ray is traced: nobody who needs this answer can go on before
    };
    DevicePipelines &device_;
    std::array<Answer, 2> answers_;
};

} // namespace vellum::layer
