// tinygltf's header, which our warnings are too strict for, without its images. Its functions are compiled here
// (tinygltf.cpp), and are nobody else's: Debian's libdraco exports those of another version, whose classes are laid out
// differently, so that a program with libtinygltf and libdraco works or crashes by the order in which they are linked.
#pragma once

#ifndef TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_INCLUDE_STB_IMAGE
#define TINYGLTF_NO_INCLUDE_STB_IMAGE_WRITE
#endif
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wold-style-cast"
#include <tiny_gltf.h>
#pragma GCC diagnostic pop
