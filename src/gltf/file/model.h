// From a glTF file's JSON to tinygltf's model of it.
#pragma once

#include <filesystem>

#include "gltf/file/container.h"

namespace tinygltf
{
class Model;
}

namespace vellum
{

// Fills `model`. Files that it names are looked for in `folder`: those of buffers are read, those of images are not
// (Image::uri names them); images in data URIs are left encoded in Image::image. Throws GltfError.
//
// tinygltf gets a JSON text of our own making, for what it does wrong: it leaves primitives that it does not understand
// out, so that all others have another number; it takes an integer of another type for one that is missing; it refuses
// indices that are compressed or without a buffer view; it reads outside of buffers for images; it knows eight kinds of
// data URIs, and stops at a wrong character in them; it opens any file that a URI names, in the current directory too;
// and an object of 2 bytes in a list takes kilobytes of memory in its model. In that text buffers and images are
// stand-ins, and extras and what else nobody here reads are not in it.
void readModel(const Container &container, const std::filesystem::path &folder, tinygltf::Model &model);

} // namespace vellum
