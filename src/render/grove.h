// SPDX-License-Identifier: Apache-2.0
// The scene that is drawn when no file is given.
#pragma once

#include "gltf/scene.h"

namespace vellum::render
{

// A few trees and bushes of two kinds, always the same: alpha-masked leaf cards and solid branches.
Scene makeGrove();

} // namespace vellum::render
