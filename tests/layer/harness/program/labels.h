// Labels of test suites and cases. tests/layer/CMakeLists.txt has the runs that take cases by them:
//
// slow: not part of ctest -L quick
//
// one_api: chooses the extension itself, or uses none; no second run by VK_KHR_opacity_micromap
//
// quirks: on a driver with all quirks of the mock driver that go together
//
// stacked: where the driver's VK_EXT_opacity_micromap is a second copy of the layer, KHR emulated and KHR translated
//
// translated: where KHR is translated to the driver's EXT
//
// serialized: not where KHR is translated, since it serializes BLASes with micromaps, which EXT cannot express
//
// inside: not where KHR is translated, since messages and sizes are those of the copy below
//
// lenient: not where KHR is translated; it breaks rules that the layer's micromaps tolerate, as a driver may not, or
// lets ray queries that do not declare it meet micromaps
//
// forced: emulated by VELLUM_FORCE_EMULATION on a driver with EXT
//
// strict, strict_ext: with VELLUM_STRICT; by VK_EXT_opacity_micromap only
//
// constants: where constant ray flags travel as others do
//
// forcing: under the forcing layer; not what looks at sizes or serialized data, at flags of pipelines and modes of
// shaders, or at modules that the layer cannot read
//
// unforced: never there
//
// packed, unpacked: in packed memory; never there
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

// Makes known what a file of tests says of its cases. The program prints all with --labels, for
// tests/runner/run_cases.py, which fails if a pattern matches no case.
class Labels
{
public:
    Labels(std::initializer_list<Labelled> labels);

    static const std::vector<Labelled> &all();
};

} // namespace vt
