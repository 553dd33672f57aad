// SPDX-License-Identifier: Apache-2.0
// Other bakers, called through the C functions of their shared libraries.
#pragma once

#include <memory>
#include <string>

#include "bake_work.h"

namespace vellum::bench
{

// 4-state data.
struct RivalResult {
    std::vector<uint8_t> data;
    std::vector<uint8_t> levels;    // of each entry
    std::vector<uint32_t> offsets;  // of each entry
    std::vector<int32_t> indices{}; // of each triangle: an entry or a special index
};

class Rival
{
public:
    virtual ~Rival() = default;
    // Bakes with these levels for the triangles, on one thread. Throws std::runtime_error.
    [[nodiscard]] virtual RivalResult bake(const BakeMesh &mesh, const std::vector<uint8_t> &levels) const = 0;

    std::string name;
};

// meshoptimizer's experimental opacityMap functions of 2026. It knows repeating textures, a cutoff of 0.5 and bilinear
// filtering. Throw std::runtime_error without the library or its functions; it stays loaded.
std::unique_ptr<Rival> loadMeshoptimizer(const std::string &library);
// The CPU baker of NVIDIA's Opacity Micromap SDK, 1.x from 1.5 on.
std::unique_ptr<Rival> loadOmmSdk(const std::string &library);

struct RivalScore {
    double micro = 0;
    double known = 0;
    double wrong = 0; // of those that it claims to know
};

// Adds up what a rival claims. `exact` is the result of Vellum's baker without tolerances: what it does not claim
// nobody may. Large results are looked at in part.
void addScore(RivalScore &score, const RivalResult &theirs, const Micromap &exact, const std::vector<uint8_t> &levels);

} // namespace vellum::bench
