// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_EXT_buffer_reference : require
// Writes 1 to a word.
layout(local_size_x = 1) in;

layout(buffer_reference, std430) buffer Word
{
    uint value;
};
layout(push_constant) uniform Push
{
    Word word;
} push;

void main()
{
    push.word.value = 1u;
}
