// The functions of tinygltf.
#define TINYGLTF_IMPLEMENTATION
#include "gltf/file/tinygltf.h"
