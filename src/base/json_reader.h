// SPDX-License-Identifier: Apache-2.0
// JSON of this program's own making, read back.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <rapidjson/document.h>
#include <rapidjson/stringbuffer.h>
#include <rapidjson/writer.h>
#include <string>
#include <string_view>

#include "base/error.h"
#include "base/text.h"

namespace vellum
{

// A JSON object whose members are read. Every function throws Error for what is missing or of another type.
class JsonReader
{
public:
    explicit JsonReader(const std::string &text)
    {
        constexpr int kMostLevels = 64; // reading and writing are recursive
        if (levelsOf(text) > kMostLevels)
            throw Error("JSON that is nested too deeply");
        document_.Parse(text.data(), text.size());
        if (document_.HasParseError() || !document_.IsObject())
            throw Error("no JSON object");
    }

    [[nodiscard]] std::string text(const char *name) const { return textOf(document_, name); }
    static std::string textOf(const rapidjson::Value &object, const char *name)
    {
        const auto member = object.FindMember(name);
        if (member == object.MemberEnd() || !member->value.IsString())
            throw Error(std::string("no string \"") + name + "\"");
        return {member->value.GetString(), member->value.GetStringLength()};
    }
    // Empty if there is no such member.
    [[nodiscard]] std::string textOr(const char *name) const { return textOr(document_, name); }
    static std::string textOr(const rapidjson::Value &object, const char *name)
    {
        return object.HasMember(name) ? textOf(object, name) : std::string();
    }
    [[nodiscard]] uint64_t hexNumber(const char *name) const
    {
        const std::optional<uint64_t> number = parseHexadecimal(text(name));
        if (!number)
            throw Error(std::string("\"") + name + "\" must be a hexadecimal number");
        return *number;
    }
    // The results of add(object) for each object of an array.
    template <typename Add>
    void forEach(const char *name, Add &&add) const
    {
        const auto member = document_.FindMember(name);
        if (member == document_.MemberEnd() || !member->value.IsArray())
            throw Error(std::string("no array \"") + name + "\"");
        for (const rapidjson::Value &element : member->value.GetArray()) {
            if (!element.IsObject())
                throw Error(std::string("no object in \"") + name + "\"");
            add(element);
        }
    }
    // A member as JSON; empty if it does not exist.
    [[nodiscard]] std::string json(const char *name) const
    {
        const auto member = document_.FindMember(name);
        if (member == document_.MemberEnd())
            return {};
        rapidjson::StringBuffer buffer;
        rapidjson::Writer<rapidjson::StringBuffer> writer(buffer);
        member->value.Accept(writer);
        return {buffer.GetString(), buffer.GetSize()};
    }

    [[nodiscard]] uint64_t number(const char *name) const { return numberOf(document_, name); }
    static uint64_t numberOf(const rapidjson::Value &object, const char *name)
    {
        const auto member = object.FindMember(name);
        if (member == object.MemberEnd() || !member->value.IsUint64())
            throw Error(std::string("no number \"") + name + "\"");
        return member->value.GetUint64();
    }

private:
    static int levelsOf(std::string_view text)
    {
        int level = 0;
        int most = 0;
        bool inString = false;
        for (size_t i = 0; i < text.size(); ++i) {
            const char c = text[i];
            if (inString && c == '\\')
                ++i;
            else if (c == '"')
                inString = !inString;
            else if (!inString && (c == '[' || c == '{'))
                most = std::max(most, ++level);
            else if (!inString && (c == ']' || c == '}'))
                --level;
        }
        return most;
    }

    rapidjson::Document document_;
};

} // namespace vellum
