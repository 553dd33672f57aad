// SPDX-License-Identifier: Apache-2.0
// The application's pNext chains are const. To remove or change a structure in one, the layer copies the chain up to
// that structure; the rest of the chain stays the application's.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <memory>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

// The name of the structure that has an sType; null if it is unknown.
const char *structureName(VkStructureType type);

// First structure of the given type in a chain, or null.
const VkBaseInStructure *findInChain(const void *chain, VkStructureType type);

template <typename T>
const T *findInChain(const void *chain, VkStructureType type)
{
    return reinterpret_cast<const T *>(findInChain(chain, type));
}

// A chain whose first structures may be copies.
class Chain
{
public:
    explicit Chain(const void *chain) : head_(chain) {}

    [[nodiscard]] const void *head() const { return head_; }
    // Removes every structure of this type. A structure behind one of unknown size cannot be removed: it stays, and a
    // driver that does not know it has to ignore it (Vulkan, "Valid Usage for Structure Pointer Chains").
    void remove(VkStructureType type);
    // Copies the first structure of this type, and returns the copy, which is part of the chain; null if there is none,
    // or it is behind one of unknown size.
    template <typename T>
    T *edit(VkStructureType type)
    {
        return reinterpret_cast<T *>(makeOwn(type));
    }
    // Puts `structure` at the head and overwrites its pNext. The caller keeps the structure alive.
    void prepend(VkBaseInStructure *structure);

private:
    struct alignas(std::max_align_t) Storage {
        std::byte bytes[sizeof(std::max_align_t)];
    };
    VkBaseInStructure *makeOwn(VkStructureType type);
    VkBaseInStructure *ownUpTo(const VkBaseInStructure *last);

    const void *head_;
    std::vector<std::unique_ptr<Storage[]>> copies_;
    std::vector<const VkBaseInStructure *> owned_;
};

// Unlinks one structure from a chain that the driver writes to, for as long as this object lives. Such chains are not
// const; the destructor restores the application's chain.
class Unlinked
{
public:
    Unlinked(void *chain, VkStructureType type); // a null chain stays as it is
    ~Unlinked();
    Unlinked(const Unlinked &) = delete;
    Unlinked &operator=(const Unlinked &) = delete;
    template <typename T>
    [[nodiscard]] T *get() const
    {
        return reinterpret_cast<T *>(structure_);
    }

private:
    VkBaseOutStructure *previous_ = nullptr;
    VkBaseOutStructure *structure_ = nullptr;
};

} // namespace vellum::layer
