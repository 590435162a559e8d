#include "code_object_reader.h"

#include <elf.h>

#include <cstring>
#include <set>
#include <stdexcept>
#include <string_view>
#include <variant>
#include <vector>

namespace raydix::standin {
namespace {

constexpr std::uint16_t machine_amdgpu = 224;
constexpr unsigned char version_4 =
    2;  // of code objects, the newest that ROCm 5.0 is known to load
constexpr std::uint32_t note_metadata = 32;

/// A value of MessagePack, as far as metadata use it.
struct Value {
    std::variant<std::uint64_t, std::string, std::vector<Value>, std::map<std::string, Value>> is;

    [[nodiscard]] const Value* find(const std::string& key) const {
        const auto* map = std::get_if<std::map<std::string, Value>>(&is);
        if (map == nullptr || !map->contains(key)) return nullptr;
        return &map->at(key);
    }
    [[nodiscard]] std::uint64_t number(const std::string& key) const {
        const Value* value = find(key);
        const auto* number = value != nullptr ? std::get_if<std::uint64_t>(&value->is) : nullptr;
        return number != nullptr ? *number : 0;
    }
    [[nodiscard]] std::string text(const std::string& key) const {
        const Value* value = find(key);
        const auto* text = value != nullptr ? std::get_if<std::string>(&value->is) : nullptr;
        return text != nullptr ? *text : "";
    }
    [[nodiscard]] std::vector<Value> list(const std::string& key) const {
        const Value* value = find(key);
        const auto* list = value != nullptr ? std::get_if<std::vector<Value>>(&value->is) : nullptr;
        return list != nullptr ? *list : std::vector<Value>();
    }
};

class Reader {
public:
    explicit Reader(std::string_view bytes) : rest_(bytes) {}

    Value value() {
        const auto head = static_cast<std::uint8_t>(take(1)[0]);
        if (head < 0x80) return {std::uint64_t{head}};
        if (head < 0x90) return map(head & 0x0F);
        if (head < 0xA0) return list(head & 0x0F);
        if (head < 0xC0) return {std::string(take(head & 0x1F))};
        switch (head) {
            case 0xC2:
                return {std::uint64_t{0}};
            case 0xC3:
                return {std::uint64_t{1}};
            case 0xCC:
                return {number(1)};
            case 0xCD:
                return {number(2)};
            case 0xCE:
                return {number(4)};
            case 0xCF:
                return {number(8)};
            case 0xD9:
                return {std::string(take(number(1)))};
            case 0xDA:
                return {std::string(take(number(2)))};
            case 0xDB:
                return {std::string(take(number(4)))};
            case 0xDC:
                return list(number(2));
            case 0xDD:
                return list(number(4));
            case 0xDE:
                return map(number(2));
            case 0xDF:
                return map(number(4));
            default:
                throw std::runtime_error("MessagePack of another kind");
        }
    }

private:
    std::string_view take(std::size_t bytes) {
        if (bytes > rest_.size()) throw std::runtime_error("MessagePack is cut off");
        const std::string_view taken = rest_.substr(0, bytes);
        rest_.remove_prefix(bytes);
        return taken;
    }
    std::uint64_t number(std::size_t bytes) {
        std::uint64_t value = 0;
        for (const char byte : take(bytes)) value = value << 8 | static_cast<std::uint8_t>(byte);
        return value;
    }
    Value list(std::uint64_t size) {
        std::vector<Value> values;
        for (std::uint64_t k = 0; k < size; ++k) values.push_back(value());
        return {std::move(values)};
    }
    Value map(std::uint64_t size) {
        std::map<std::string, Value> values;
        for (std::uint64_t k = 0; k < size; ++k) {
            const Value key = value();
            values.emplace(std::get<std::string>(key.is), value());
        }
        return {std::move(values)};
    }

    std::string_view rest_;
};

template <class T>
T at(const char* image, std::uint64_t offset) {
    T value;
    std::memcpy(&value, image + offset, sizeof(value));
    return value;
}

/// The bytes of the metadata note; empty if there is none.
std::string_view metadata_of(const char* image, const Elf64_Ehdr& header) {
    for (std::uint32_t k = 0; k < header.e_phnum; ++k) {
        const auto segment =
            at<Elf64_Phdr>(image, header.e_phoff + std::uint64_t{k} * header.e_phentsize);
        if (segment.p_type != PT_NOTE) continue;
        const auto note = at<Elf64_Nhdr>(image, segment.p_offset);
        const std::uint64_t name = segment.p_offset + sizeof(note);
        if (note.n_type == note_metadata && std::string_view(image + name) == "AMDGPU")
            return {image + name + (note.n_namesz + 3) / 4 * 4, note.n_descsz};
    }
    return {};
}

std::set<std::string> symbols_of(const char* image, const Elf64_Ehdr& header) {
    std::set<std::string> names;
    const auto section = [&](std::uint32_t k) {
        return at<Elf64_Shdr>(image, header.e_shoff + std::uint64_t{k} * header.e_shentsize);
    };
    for (std::uint32_t k = 0; k < header.e_shnum; ++k) {
        const Elf64_Shdr table = section(k);
        if (table.sh_type != SHT_DYNSYM) continue;
        const std::uint64_t strings = section(table.sh_link).sh_offset;
        for (std::uint64_t s = 0; s < table.sh_size; s += sizeof(Elf64_Sym))
            names.insert(image + strings + at<Elf64_Sym>(image, table.sh_offset + s).st_name);
    }
    return names;
}

}  // namespace

std::optional<CodeObject> read_code_object(const char* image) {
    const auto header = at<Elf64_Ehdr>(image, 0);
    if (std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0 ||
        header.e_ident[EI_CLASS] != ELFCLASS64 || header.e_machine != machine_amdgpu ||
        header.e_ident[EI_ABIVERSION] != version_4)
        return {};
    try {
        const Value metadata = Reader(metadata_of(image, header)).value();
        const std::set<std::string> symbols = symbols_of(image, header);
        CodeObject code{metadata.text("amdhsa.target"), {}};
        for (const Value& kernel : metadata.list("amdhsa.kernels")) {
            KernelNote note{0, 0, kernel.number(".kernarg_segment_size"),
                            kernel.number(".max_flat_workgroup_size"), kernel.text(".symbol")};
            for (const Value& argument : kernel.list(".args")) {
                if (argument.text(".value_kind").starts_with("hidden")) continue;
                ++note.arguments;
                if (argument.number(".offset") == 0) note.argument_bytes = argument.number(".size");
            }
            if (!symbols.contains(note.symbol)) return {};
            code.kernels.emplace(kernel.text(".name"), note);
        }
        return code;
    } catch (const std::exception&) {
        return {};
    }
}

}  // namespace raydix::standin
