#include "cli/surface_report.h"

#include "cli/base/numbers.h"

namespace vellum::cli
{

std::string describe(const SurfaceShares &surface)
{
    return percent(surface.known()) + " of the alpha-tested surface is known";
}

void write(const std::optional<SurfaceShares> &surface, JsonWriter &json)
{
    if (!surface) {
        json.null();
        return;
    }
    json.beginObject().member("known", surface->known());
    for (size_t s = 0; s < surface->states.size(); ++s)
        json.member(kStateNames[s], surface->states[s]);
    json.member("withoutMicromap", surface->withoutMicromap).end();
}

} // namespace vellum::cli
