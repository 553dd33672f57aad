// How the share of a surface that is known is printed.
#pragma once

#include <optional>
#include <string>

#include "gltf/file/json_writer.h"
#include "gltf/micromaps/known_surface.h"

namespace vellum::cli
{

// Of JSON.
constexpr const char *kStateNames[] = {"transparent", "opaque", "unknownTransparent", "unknownOpaque"};

// "61.2 % of the alpha-tested surface is known"
std::string describe(const SurfaceShares &surface);

// An object, or null where there is none.
void write(const std::optional<SurfaceShares> &surface, JsonWriter &json);

} // namespace vellum::cli
