// SPDX-License-Identifier: Apache-2.0
#include "check/case/case.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <rapidjson/document.h>
#include <rapidjson/error/en.h>
#include <stdexcept>

#include "check/case/bytes.h"
#include "check/case/fields.h"

namespace vellum::check
{
namespace
{

using Json = rapidjson::Value;
using Allocator = rapidjson::Document::AllocatorType;

constexpr std::string_view kSchema = "vellum-check/1";
constexpr std::string_view kNan = "nan";   // a number of an inactive triangle or box
constexpr uint32_t kMostPlainStates = 256; // more are written as lengths of runs
constexpr size_t kLineWidth = 100;
constexpr uint64_t kMostElements = uint64_t{1} << 24; // of all lists of a case
constexpr const char *kRepeat = "repeat";             // how often an element of a list follows itself
constexpr size_t kShortestRun = 4;                    // of triangles that are written as one
constexpr size_t kMostPlainIndices = 16;              // in a row; as many and more are written as one

template <class T>
bool same(const T &a, const T &b)
{
    if constexpr (std::is_same_v<T, float>)
        return std::memcmp(&a, &b, sizeof a) == 0; // 0 and -0 are different
    else
        return a == b;
}

// The n-th of triangles that are moved copies of one.
Vec3 moved(const Vec3 &vertex, const Vec3 &step, size_t n)
{
    Vec3 out = vertex;
    for (size_t i = 0; n > 0 && i < 3; ++i)
        out[i] += step[i] * static_cast<float>(n);
    return out;
}

// The number of triangles from vertex `from` on that are the first one, moved by a multiple of `step`.
size_t runOfTriangles(const std::vector<Vec3> &vertices, size_t from, Vec3 &step)
{
    if (vertices.size() - from < 6)
        return 1;
    for (size_t i = 0; i < 3; ++i)
        step[i] = vertices[from + 3][i] - vertices[from][i];
    if (!std::ranges::all_of(step, [](float value) { return std::isfinite(value); }))
        return 1; // an inactive one
    size_t count = 1;
    const auto continues = [&] {
        for (size_t k = 0; k < 3; ++k) {
            const Vec3 expected = moved(vertices[from + k], step, count);
            for (size_t i = 0; i < 3; ++i)
                if (!same(vertices[from + 3 * count + k][i], expected[i]))
                    return false;
        }
        return true;
    };
    while (from + 3 * count + 3 <= vertices.size() && continues())
        ++count;
    return count;
}

// The number of indices from `from` on that differ from the one before by `step`.
size_t runOfIndices(const std::vector<int32_t> &indices, size_t from, int32_t &step)
{
    if (from + 1 == indices.size())
        return 1;
    const int64_t difference = int64_t{indices[from + 1]} - indices[from];
    if (difference != 0 && difference != 1)
        return 1;
    step = static_cast<int32_t>(difference);
    size_t count = 1;
    while (from + count < indices.size() && int64_t{indices[from + count]} - indices[from + count - 1] == step)
        ++count;
    return count;
}

std::string statesText(const std::vector<uint8_t> &states)
{
    std::string text;
    for (size_t i = 0; i < states.size();) {
        size_t end = i + 1;
        while (states.size() > kMostPlainStates && end < states.size() && states[end] == states[i])
            ++end;
        if (end - i > 1)
            text += std::to_string(end - i);
        text += states[i] < 4 ? kStateLetters[states[i]] : '?';
        i = end;
    }
    return text;
}

// Makes an object of the fields.
class Writer
{
public:
    explicit Writer(Allocator &allocator) : allocator_(allocator), out_(rapidjson::kObjectType) {}
    Json take() { return std::move(out_); }

    template <class T>
    void always(const char *key, const T &field)
    {
        add(key, toValue(field));
    }
    template <class T>
    void value(const char *key, const T &field, const T &standard)
    {
        if (!same(field, standard))
            add(key, toValue(field));
    }
    template <class T, size_t N>
    void name(const char *key, T field, const std::array<Name<T>, N> &names)
    {
        add(key, toValue(std::string(nameOf(names, field))));
    }
    template <class T, size_t N>
    void name(const char *key, T field, const std::array<Name<T>, N> &names, T standard)
    {
        if (field != standard)
            name(key, field, names);
    }
    template <size_t N>
    void bits(const char *key, uint32_t field, const std::array<Bit, N> &names)
    {
        Json list(rapidjson::kArrayType);
        for (const Bit &bit : names)
            if ((field & bit.value) != 0)
                list.PushBack(toValue(std::string(bit.name)), allocator_);
        if ((field & ~allOf(names)) != 0)
            list.PushBack(toValue(fmt::format("{:#x}", field & ~allOf(names))), allocator_);
        if (!list.Empty())
            add(key, std::move(list));
    }
    template <size_t N>
    void floats(const char *key, const std::array<float, N> &field)
    {
        add(key, toList(field));
    }
    void states(const char *key, const std::vector<uint8_t> &field) { add(key, toValue(statesText(field))); }
    void vectors(const char *key, const std::vector<Vec3> &field)
    {
        Json list(rapidjson::kArrayType);
        for (size_t i = 0; i < field.size();) {
            Vec3 step{};
            const size_t count = runOfTriangles(field, i, step);
            if (count < kShortestRun) {
                list.PushBack(toList(field[i++]), allocator_);
                continue;
            }
            Writer run(allocator_);
            run.always(kRepeat, static_cast<uint32_t>(count));
            run.addLists("triangle", std::vector<Vec3>{field[i], field[i + 1], field[i + 2]});
            if (step != Vec3{})
                run.floats("step", step);
            list.PushBack(run.take(), allocator_);
            i += 3 * count;
        }
        if (!list.Empty())
            add(key, std::move(list));
    }
    void vectors(const char *key, const std::vector<VkAabbPositionsKHR> &field)
    {
        std::vector<std::array<float, 6>> boxes;
        for (const VkAabbPositionsKHR &box : field)
            boxes.push_back({box.minX, box.minY, box.minZ, box.maxX, box.maxY, box.maxZ});
        addLists(key, boxes);
    }
    void vectors(const char *key, const float (&field)[3][4]) { addLists(key, field); }
    void indices(const char *key, const std::vector<int32_t> &field)
    {
        Json list(rapidjson::kArrayType);
        for (size_t i = 0; i < field.size();) {
            int32_t step = 0;
            const size_t count = runOfIndices(field, i, step);
            if (count < kMostPlainIndices) {
                for (const size_t end = i + count; i < end; ++i)
                    list.PushBack(toValue(field[i]), allocator_);
                continue;
            }
            Writer run(allocator_);
            run.always(kRepeat, static_cast<uint32_t>(count));
            run.always("index", field[i]);
            run.value("step", step, 0);
            list.PushBack(run.take(), allocator_);
            i += count;
        }
        add(key, std::move(list));
    }
    void indices(const char *key, const std::vector<uint32_t> &field)
    {
        if (!field.empty())
            add(key, toList(field));
    }
    template <class T, size_t N>
    void names(const char *key, const std::vector<T> &field, const std::array<Name<T>, N> &names)
    {
        Json list(rapidjson::kArrayType);
        for (const T value : field)
            list.PushBack(toValue(std::string(nameOf(names, value))), allocator_);
        if (!list.Empty())
            add(key, std::move(list));
    }
    template <class T>
    void object(const char *key, const T &field)
    {
        Json made = toObject(field);
        if (!made.ObjectEmpty())
            add(key, std::move(made));
    }
    template <class T>
    void optional(const char *key, const std::optional<T> &field)
    {
        if (field)
            add(key, toObject(*field));
    }
    template <class T>
    void list(const char *key, const std::vector<T> &field)
    {
        Json list(rapidjson::kArrayType);
        const auto bytesOf = [&](size_t i) {
            Bytes bytes;
            if (field.size() > 1)
                fields::of(bytes, field[i]);
            return bytes.text();
        };
        std::string bytes = field.empty() ? std::string() : bytesOf(0);
        for (size_t i = 0; i < field.size();) {
            size_t end = i + 1;
            std::string next;
            while (end < field.size() && (next = bytesOf(end)) == bytes)
                ++end;
            Writer element(allocator_);
            element.value(kRepeat, static_cast<uint32_t>(end - i), 1u);
            fields::of(element, field[i]);
            list.PushBack(element.take(), allocator_);
            bytes = std::move(next);
            i = end;
        }
        if (!list.Empty())
            add(key, std::move(list));
    }

private:
    void add(const char *key, Json made) { out_.AddMember(rapidjson::StringRef(key), std::move(made), allocator_); }
    Json toValue(const std::string &text)
    {
        return Json(text.data(), static_cast<rapidjson::SizeType>(text.size()), allocator_);
    }
    Json toValue(float number)
    {
        if (std::isnan(number))
            return toValue(std::string(kNan));
        return std::isfinite(number) ? Json(double{number}) : toValue(fmt::format("{}", number));
    }
    template <class T>
    Json toValue(const std::optional<T> &field)
    {
        return toValue(*field);
    } // not the default
    template <class T>
    Json toValue(const T &field)
    {
        return Json(field);
    }
    template <class T>
    Json toList(const T &field)
    {
        Json list(rapidjson::kArrayType);
        for (const auto &element : field)
            list.PushBack(toValue(element), allocator_);
        return list;
    }
    template <class T>
    void addLists(const char *key, const T &field)
    {
        Json list(rapidjson::kArrayType);
        for (const auto &element : field)
            list.PushBack(toList(element), allocator_);
        if (!list.Empty())
            add(key, std::move(list));
    }
    template <class T>
    Json toObject(const T &field)
    {
        Writer writer(allocator_);
        fields::of(writer, field);
        return writer.take();
    }

    Allocator &allocator_;
    Json out_;
};

// The fewest digits that read back the same float.
std::string numberText(const Json &number)
{
    if (number.IsUint64())
        return std::to_string(number.GetUint64());
    if (number.IsInt64())
        return std::to_string(number.GetInt64());
    std::string text = fmt::format("{}", static_cast<float>(number.GetDouble()));
    return text == "-0" ? "-0.0" : text;
}

std::string stringText(const Json &string)
{
    std::string text = "\"";
    for (const char c : std::string_view(string.GetString(), string.GetStringLength())) {
        if (c == '"' || c == '\\')
            text += std::string("\\") + c;
        else if (static_cast<unsigned char>(c) < 0x20)
            text += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
        else
            text += c;
    }
    return text + '"';
}

// A value that fits in a line is written in one.
std::string textOf(const Json &json, size_t indent)
{
    if (json.IsBool())
        return json.GetBool() ? "true" : "false";
    if (json.IsNumber())
        return numberText(json);
    if (json.IsString())
        return stringText(json);
    std::vector<std::string> parts;
    if (json.IsObject()) {
        for (const auto &member : json.GetObject())
            parts.push_back(stringText(member.name) + ": " + textOf(member.value, indent + 2));
    } else {
        for (const Json &element : json.GetArray())
            parts.push_back(textOf(element, indent + 2));
    }
    size_t width = indent;
    bool lines = false;
    for (const std::string &part : parts) {
        width += part.size() + 2;
        lines |= part.find('\n') != std::string::npos;
    }
    lines |= width > kLineWidth;
    const std::string gap = lines ? "\n" + std::string(indent + 2, ' ') : "";
    std::string text(1, json.IsObject() ? '{' : '[');
    for (size_t i = 0; i < parts.size(); ++i)
        text += (i == 0 ? "" : lines ? "," : ", ") + gap + parts[i];
    text += lines ? "\n" + std::string(indent, ' ') : "";
    return text + (json.IsObject() ? '}' : ']');
}

[[noreturn]] void reject(const std::string &where, const std::string &what)
{
    throw std::runtime_error((where.empty() ? "the case" : where) + ": " + what);
}

// Reads the fields of an object and rejects others.
class Reader
{
public:
    // Counts the parts of the whole case: the expansion of a short file is bounded.
    struct Amount {
        uint64_t states = 0, elements = 0;
    };

    Reader(const Json &json, std::string where, Amount &amount) : json_(json), where_(std::move(where)), amount_(amount)
    {
        if (!json.IsObject())
            reject(where_, "is not an object");
    }

    void finish() const
    {
        for (const auto &member : json_.GetObject()) {
            const std::string name(member.name.GetString(), member.name.GetStringLength());
            const auto again =
                std::ranges::count_if(json_.GetObject(), [&](const auto &other) { return other.name == member.name; });
            if (std::ranges::find(known_, name) == known_.end())
                reject(where_, "has an unknown field, \"" + printable(name) + "\"");
            if (again > 1)
                reject(where_, "has the field \"" + name + "\" twice");
        }
    }

    template <class T>
    void always(const char *key, T &field)
    {
        get(needed(key), path(key), field);
    }
    template <class T>
    void value(const char *key, T &field, const T &standard)
    {
        field = standard;
        if (const Json *found = find(key))
            get(*found, path(key), field);
    }
    template <class T, size_t N>
    void name(const char *key, T &field, const std::array<Name<T>, N> &names)
    {
        field = named(needed(key), path(key), names);
    }
    template <class T, size_t N>
    void name(const char *key, T &field, const std::array<Name<T>, N> &names, T standard)
    {
        const Json *found = find(key);
        // "conditional" was a boolean.
        if (std::is_same_v<T, Conditional> && found != nullptr && found->IsBool())
            field = found->GetBool() ? names[1].value : standard;
        else
            field = found != nullptr ? named(*found, path(key), names) : standard;
    }
    template <size_t N>
    void bits(const char *key, uint32_t &field, const std::array<Bit, N> &names)
    {
        field = 0;
        forEach(key, [&](const Json &element, const std::string &where) { field |= named(element, where, names); });
    }
    template <size_t N>
    void floats(const char *key, std::array<float, N> &field)
    {
        getFloats(needed(key), path(key), field);
    }
    void states(const char *key, std::vector<uint8_t> &field);
    void vectors(const char *key, std::vector<Vec3> &field)
    {
        forEach(key, [&](const Json &element, const std::string &where) {
            if (!element.IsObject())
                return getFloats(element, where, field.emplace_back());
            Reader run(element, where, amount_);
            const uint32_t count = run.repeat();
            const Json &corners = run.needed("triangle");
            if (!corners.IsArray() || corners.Size() != 3)
                reject(run.path("triangle"), "is not a list of 3 vertices");
            std::array<Vec3, 3> triangle{};
            for (rapidjson::SizeType k = 0; k < 3; ++k)
                getFloats(corners[k], fmt::format("{}[{}]", run.path("triangle"), k), triangle[k]);
            Vec3 step{};
            if (run.find("step") != nullptr)
                run.floats("step", step);
            run.finish();
            for (uint32_t i = 0; i < count; ++i)
                for (const Vec3 &vertex : triangle)
                    field.push_back(moved(vertex, step, i));
        });
    }
    void vectors(const char *key, std::vector<VkAabbPositionsKHR> &field)
    {
        forEach(key, [&](const Json &element, const std::string &where) {
            std::array<float, 6> box{};
            getFloats(element, where, box);
            field.push_back({box[0], box[1], box[2], box[3], box[4], box[5]});
        });
    }
    void vectors(const char *key, float (&field)[3][4])
    {
        const Json &rows = needed(key);
        if (!rows.IsArray() || rows.Size() != 3)
            reject(path(key), "is not a list of 3 rows");
        for (rapidjson::SizeType row = 0; row < 3; ++row) {
            std::array<float, 4> values{};
            getFloats(rows[row], fmt::format("{}[{}]", path(key), row), values);
            std::ranges::copy(values, field[row]);
        }
    }
    template <class T, size_t N>
    void names(const char *key, std::vector<T> &field, const std::array<Name<T>, N> &names)
    {
        forEach(key,
                [&](const Json &element, const std::string &where) { field.push_back(named(element, where, names)); });
    }
    template <class T>
    void indices(const char *key, std::vector<T> &field)
    {
        forEach(key, [&](const Json &element, const std::string &where) {
            if (!element.IsObject())
                return get(element, where, field.emplace_back());
            Reader run(element, where, amount_);
            const uint32_t count = run.repeat();
            int32_t index = 0, step = 0;
            run.always("index", index);
            run.value("step", step, 0);
            run.finish();
            for (uint32_t i = 0; i < count; ++i)
                field.push_back(static_cast<T>(std::clamp<int64_t>(index + int64_t{i} * step, INT32_MIN, INT32_MAX)));
        });
    }
    template <class T>
    void object(const char *key, T &field)
    {
        if (const Json *found = find(key))
            getObject(*found, path(key), field);
    }
    template <class T>
    void optional(const char *key, std::optional<T> &field)
    {
        if (const Json *found = find(key))
            getObject(*found, path(key), field.emplace());
    }
    template <class T>
    void list(const char *key, std::vector<T> &field)
    {
        forEach(key, [&](const Json &element, const std::string &where) {
            Reader reader(element, where, amount_);
            const uint32_t count = reader.repeat();
            const Amount before = amount_;
            T made{};
            fields::of(reader, made);
            reader.finish();
            amount_.states += (count - 1) * (amount_.states - before.states);
            addElements((count - 1) * (amount_.elements - before.elements), where);
            rejectManyStates(where);
            field.insert(field.end(), count, made);
        });
    }

private:
    // The number of repetitions of this element of a list.
    uint32_t repeat()
    {
        uint32_t count = 1;
        value(kRepeat, count, 1u);
        if (count == 0)
            reject(path(kRepeat), "is 0");
        addElements(count - 1, where_);
        return count;
    }
    void addElements(uint64_t count, const std::string &where) const
    {
        amount_.elements += count;
        if (amount_.elements > kMostElements)
            reject(where, fmt::format("more than {} elements of lists in all", kMostElements));
    }
    void rejectManyStates(const std::string &where) const
    {
        if (amount_.states > kMostStates)
            reject(where, fmt::format("more than {} micro-triangles in all", kMostStates));
    }

    static std::string printable(const std::string &text)
    {
        std::string out = text.substr(0, 60);
        std::ranges::replace_if(
            out, [](char c) { return static_cast<unsigned char>(c) < 0x20; }, '?');
        return out;
    }
    [[nodiscard]] std::string path(const char *key) const { return where_.empty() ? key : where_ + "." + key; }
    const Json *find(const char *key)
    {
        known_.emplace_back(key);
        const auto member = json_.FindMember(key);
        return member != json_.MemberEnd() ? &member->value : nullptr;
    }
    const Json &needed(const char *key)
    {
        const Json *found = find(key);
        if (found == nullptr)
            reject(path(key), "is missing");
        return *found;
    }
    template <class Function>
    void forEach(const char *key, Function &&function)
    {
        const Json *found = find(key);
        if (found == nullptr)
            return;
        if (!found->IsArray())
            reject(path(key), "is not a list");
        addElements(found->Size(), path(key));
        for (rapidjson::SizeType i = 0; i < found->Size(); ++i)
            function((*found)[i], fmt::format("{}[{}]", path(key), i));
    }
    template <class T>
    void getObject(const Json &json, const std::string &where, T &field)
    {
        Reader reader(json, where, amount_);
        fields::of(reader, field);
        reader.finish();
    }

    template <class T, size_t N>
    static T named(const Json &json, const std::string &where, const std::array<Name<T>, N> &names)
    {
        if (!json.IsString())
            reject(where, "is not a string");
        const std::string text(json.GetString(), json.GetStringLength());
        std::string all;
        for (const Name<T> &name : names) {
            if (name.name == text)
                return name.value;
            all += (all.empty() ? "" : ", ") + std::string(name.name);
        }
        reject(where, "\"" + printable(text) + "\" is not one of " + all);
    }
    template <size_t N>
    static void getFloats(const Json &json, const std::string &where, std::array<float, N> &field)
    {
        if (!json.IsArray() || json.Size() != N)
            reject(where, fmt::format("is not a list of {} numbers", N));
        for (rapidjson::SizeType i = 0; i < N; ++i)
            get(json[i], where, field[i]);
    }
    static void get(const Json &json, const std::string &where, float &field)
    {
        if (json.IsString() && kNan == json.GetString()) {
            field = std::numeric_limits<float>::quiet_NaN();
            return;
        }
        if (!json.IsNumber())
            reject(where, "is not a number");
        const double value = json.GetDouble();
        if (!(std::abs(value) <= double{std::numeric_limits<float>::max()}))
            reject(where, "is out of range");
        field = static_cast<float>(value);
    }
    static void get(const Json &json, const std::string &where, bool &field)
    {
        if (!json.IsBool())
            reject(where, "is neither true nor false");
        field = json.GetBool();
    }
    static void get(const Json &json, const std::string &where, uint32_t &field)
    {
        if (!json.IsUint())
            reject(where, "is not a whole number of 32 bits");
        field = json.GetUint();
    }
    static void get(const Json &json, const std::string &where, uint64_t &field)
    {
        if (!json.IsUint64())
            reject(where, "is not a whole number of 64 bits");
        field = json.GetUint64();
    }
    static void get(const Json &json, const std::string &where, int32_t &field)
    {
        if (!json.IsInt())
            reject(where, "is not a whole number with sign of 32 bits");
        field = json.GetInt();
    }
    static void get(const Json &json, const std::string &where, std::string &field)
    {
        if (!json.IsString())
            reject(where, "is not a string");
        field.assign(json.GetString(), json.GetStringLength());
    }
    template <class T>
    static void get(const Json &json, const std::string &where, std::optional<T> &field)
    {
        get(json, where, field.emplace());
    }

    const Json &json_;
    std::string where_;
    Amount &amount_;
    std::vector<std::string> known_;
};

void Reader::states(const char *key, std::vector<uint8_t> &field)
{
    std::string text;
    get(needed(key), path(key), text);
    uint64_t count = 0;
    for (size_t i = 0; i < text.size(); ++i) {
        if (text[i] >= '0' && text[i] <= '9') {
            count = std::min<uint64_t>(10 * count + static_cast<uint64_t>(text[i] - '0'), kMostStates + 1);
            if (count > 0 && i + 1 < text.size())
                continue;
            reject(path(key), "has a wrong length of a run");
        }
        const size_t state = std::string_view(kStateLetters).find(text[i]);
        if (state == std::string_view::npos)
            reject(path(key), "has a state that is not T, O, t or o");
        count = std::max<uint64_t>(count, 1);
        amount_.states += count;
        rejectManyStates(path(key));
        field.insert(field.end(), count, static_cast<uint8_t>(state));
        count = 0;
    }
}

std::string placeOf(std::string_view text, size_t offset)
{
    const std::string_view before = text.substr(0, offset);
    const auto line = std::ranges::count(before, '\n') + 1;
    const size_t begin = before.rfind('\n');
    return fmt::format("line {}, column {}", line, begin == std::string_view::npos ? offset + 1 : offset - begin);
}

} // namespace

std::string toJson(const Case &c)
{
    rapidjson::Document document(rapidjson::kObjectType);
    Writer writer(document.GetAllocator());
    writer.always("schema", std::string(kSchema));
    fields::of(writer, c);
    return textOf(writer.take(), 0) + "\n";
}

Case caseFromJson(std::string_view text)
{
    rapidjson::Document document;
    constexpr unsigned kFlags =
        rapidjson::kParseFullPrecisionFlag | rapidjson::kParseIterativeFlag | rapidjson::kParseValidateEncodingFlag;
    document.Parse<kFlags>(text.data(), text.size());
    if (document.HasParseError())
        reject(placeOf(text, document.GetErrorOffset()), rapidjson::GetParseError_En(document.GetParseError()));
    Reader::Amount amount;
    Reader reader(document, "", amount);
    std::string schema;
    reader.always("schema", schema);
    if (schema != kSchema)
        reject("schema", "is not \"" + std::string(kSchema) + "\"");
    Case c;
    fields::of(reader, c);
    reader.finish();
    if (const std::string broken = invalid(c); !broken.empty())
        throw std::runtime_error(broken);
    return c;
}

} // namespace vellum::check
