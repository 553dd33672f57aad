// SPDX-License-Identifier: Apache-2.0
// Labels of test suites and cases, by which tests/layer/CMakeLists.txt chooses the cases of each run:
//
// slow: not part of ctest -L quick
//
// threads: multithreaded; run with ThreadSanitizer
//
// one_api: chooses the extension itself, or uses none; no second run by VK_KHR_opacity_micromap
//
// quirks: also on a driver with all compatible quirks of the mock driver
//
// stacked: also over a second copy of the layer that provides VK_EXT_opacity_micromap, emulating and translating KHR
//
// translated: where KHR is translated to the driver's EXT
//
// serialized: not where KHR is translated: it serializes BLASes with micromaps, which EXT cannot express
//
// inside: not where KHR is translated: messages and sizes are those of the copy below
//
// lenient: not where KHR is translated: it breaks rules that the layer tolerates and a driver may not, or uses
// micromaps in ray queries that do not declare them
//
// forced: emulated by VELLUM_IMPLEMENTATION on a driver with EXT
//
// strict, strict_ext: with VELLUM_STRICT; by VK_EXT_opacity_micromap only
//
// constants: also with constant ray flags preserved like others
//
// forcing: also under the forcing layer; not for tests of sizes, serialized data, pipeline flags, execution modes or
// modules that the layer cannot read
//
// unforced: never under the forcing layer
//
// packed, unpacked: also in packed memory; never in packed memory
#pragma once

#include <initializer_list>
#include <string>
#include <vector>

namespace vt
{

struct Labelled {
    std::string cases;  // a pattern, as for --gtest_filter
    std::string labels; // with spaces between
};

// Registers the labels of a file's cases. The program prints all with --labels, for
// tests/runner/run_cases.py, which fails if a pattern matches no case.
class Labels
{
public:
    Labels(std::initializer_list<Labelled> labels);

    static const std::vector<Labelled> &all();
};

} // namespace vt
