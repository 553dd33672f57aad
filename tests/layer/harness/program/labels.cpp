// SPDX-License-Identifier: Apache-2.0
#include "harness/program/labels.h"

namespace vt
{
namespace
{

std::vector<Labelled> &known()
{
    static std::vector<Labelled> labels;
    return labels;
}

} // namespace

Labels::Labels(std::initializer_list<Labelled> labels)
{
    known().insert(known().end(), labels);
}

const std::vector<Labelled> &Labels::all()
{
    return known();
}

} // namespace vt
