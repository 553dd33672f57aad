// SPDX-License-Identifier: Apache-2.0
// A case, or a part of it, as bytes: what has the same bytes is the same. An archive of fields.h.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "check/case/fields.h"

namespace vellum::check
{

class Bytes
{
public:
    [[nodiscard]] const std::string &text() const { return text_; }

    template <class T>
    void always(const char *, const T &field)
    {
        put(field);
    }
    template <class T>
    void value(const char *, const T &field, const T &)
    {
        put(field);
    }
    template <class T, class... Names>
    void name(const char *, T field, const Names &...)
    {
        put(field);
    }
    template <class Names>
    void bits(const char *, uint32_t field, const Names &)
    {
        put(field);
    }
    template <size_t N>
    void floats(const char *, const std::array<float, N> &field)
    {
        put(field);
    }
    void states(const char *, const std::vector<uint8_t> &field) { putAll(field); }
    template <class T>
    void vectors(const char *, const std::vector<T> &field)
    {
        putAll(field);
    }
    void vectors(const char *, const float (&field)[3][4]) { put(field); }
    template <class T>
    void indices(const char *, const std::vector<T> &field)
    {
        putAll(field);
    }
    template <class T, class Names>
    void names(const char *, const std::vector<T> &field, const Names &)
    {
        putAll(field);
    }
    template <class T>
    void object(const char *, const T &field)
    {
        fields::of(*this, field);
    }
    template <class T>
    void optional(const char *, const std::optional<T> &field)
    {
        put(field.has_value());
        if (field)
            fields::of(*this, *field);
    }
    template <class T>
    void list(const char *, const std::vector<T> &field)
    {
        put(field.size());
        for (const T &element : field)
            fields::of(*this, element);
    }

private:
    // Only types without padding.
    template <class T>
    void put(const T &field)
    {
        static_assert(std::is_trivially_copyable_v<T>);
        text_.append(reinterpret_cast<const char *>(&field), sizeof field);
    }
    void put(const std::string &field)
    {
        put(field.size());
        text_ += field;
    }
    template <class T>
    void put(const std::optional<T> &field)
    {
        put(field.has_value());
        if (field)
            put(*field);
    }
    template <class T>
    void putAll(const std::vector<T> &field)
    {
        put(field.size());
        text_.append(reinterpret_cast<const char *>(field.data()), field.size() * sizeof(T));
    }

    std::string text_;
};

} // namespace vellum::check
