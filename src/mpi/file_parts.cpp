// Files -> the part of each rank, read by offset: rank r of R reads elements n r / R to
// n (r + 1) / R of all files, and of meshes the vertices that these use.
#include <raydix/error.h>
#include <raydix/mpi.h>
#include <raydix/rdx_scene.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/math.h"
#include "io/rdx_meshes.h"
#include "mpi/agree.h"
#include "mpi/communicator.h"
#include "scene/byte_source.h"
#include "scene/npy.h"
#include "scene/ply_header.h"

namespace raydix::mpi {
namespace {

/// Where numbers of one kind lie in records of one size.
struct Records {
    std::uint64_t begin = 0, count = 0;  // in the file
    std::size_t bytes = 0;               // of a record

    [[nodiscard]] std::uint64_t end() const { return begin + count * bytes; }
};

struct NumberPlace {
    PlyType type = PlyType::f32;
    std::size_t offset = 0;  // in its record
};

/// How a mesh of a file is to be read.
struct Plan {
    std::filesystem::path file = {};
    bool swapped = false;  // other byte order than this machine
    Records vertices, faces;
    std::array<NumberPlace, 3> position;
    std::size_t list = 0;        // where the list of corners begins in a face
    bool counts_corners = true;  // the list begins with their number
    PlyType count_type = PlyType::u8, index_type = PlyType::i32;
};

template <class T>
T number_at(const char* bytes, bool swapped) {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), bytes, sizeof(T));
    if (swapped) std::reverse(raw.begin(), raw.end());
    return std::bit_cast<T>(raw);
}

float coordinate(const char* record, const NumberPlace& place, bool swapped) {
    const char* at = record + place.offset;
    return place.type == PlyType::f64 ? static_cast<float>(number_at<double>(at, swapped))
                                      : number_at<float>(at, swapped);
}

/// Negative indices become large: there is no such vertex.
std::uint64_t whole_number(const char* at, PlyType type, bool swapped) {
    switch (byte_size(type)) {
        case 1:
            return type == PlyType::i8
                       ? std::uint64_t(std::int64_t(number_at<std::int8_t>(at, false)))
                       : number_at<std::uint8_t>(at, false);
        case 2:
            return type == PlyType::i16
                       ? std::uint64_t(std::int64_t(number_at<std::int16_t>(at, swapped)))
                       : number_at<std::uint16_t>(at, swapped);
        default:
            return type == PlyType::i32
                       ? std::uint64_t(std::int64_t(number_at<std::int32_t>(at, swapped)))
                       : number_at<std::uint32_t>(at, swapped);
    }
}

bool is_whole(PlyType type) { return type != PlyType::f32 && type != PlyType::f64; }

/// False if vertices cannot be read by offset.
bool plan_vertices(const PlyElement& element, Plan& plan) {
    constexpr const char* names[3] = {"x", "y", "z"};
    for (std::size_t d = 0; d < 3; ++d) {
        const int found = element.find(names[d]);
        if (found < 0) return false;
        plan.position[d] = {element.properties[std::size_t(found)].type, 0};
        if (is_whole(plan.position[d].type)) return false;
        for (int k = 0; k < found; ++k)
            plan.position[d].offset += byte_size(element.properties[std::size_t(k)].type);
    }
    plan.vertices.bytes = element.record_bytes();
    return plan.vertices.bytes != 0;
}

/// The size of a face that is a triangle. False if there is more than one list.
bool plan_faces(const PlyElement& element, Plan& plan) {
    int list = element.find("vertex_indices");
    if (list < 0) list = element.find("vertex_index");
    if (list < 0) return false;
    for (std::size_t k = 0; k < element.properties.size(); ++k) {
        const PlyProperty& property = element.properties[k];
        if (int(k) != list) {
            if (property.is_list) return false;
            if (int(k) < list) plan.list += byte_size(property.type);
            plan.faces.bytes += byte_size(property.type);
            continue;
        }
        if (!property.is_list || !is_whole(property.type) || !is_whole(property.count_type))
            return false;
        plan.count_type = property.count_type;
        plan.index_type = property.type;
        plan.faces.bytes += byte_size(property.count_type) + 3 * byte_size(property.type);
    }
    return true;
}

std::optional<Plan> plan_ply(ByteSource& in, std::uint64_t size) {
    LineReader lines(in);
    const PlyHeader header = read_ply_header(lines);
    if (header.format == PlyFormat::ascii) return {};
    Plan plan;
    plan.swapped = header.format == PlyFormat::big_endian;
    std::uint64_t at = size - in.expected_rest();
    bool has_vertices = false;
    for (const PlyElement& element : header.elements) {
        const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
        if (element.name == "tristrips" || (is_vertex && has_vertices) ||
            (is_face && plan.faces.bytes != 0))
            return {};
        Records other;
        Records& records = is_vertex ? plan.vertices : is_face ? plan.faces : other;
        other.bytes = element.record_bytes();
        if (is_vertex && !plan_vertices(element, plan)) return {};
        if (is_face && !plan_faces(element, plan)) return {};
        has_vertices |= is_vertex;
        records.begin = at;
        records.count = element.count;
        // Lists of other lengths, and files that end early, are for load_model to judge.
        if (records.bytes == 0 || element.count > (size - at) / records.bytes) return {};
        at = records.end();
    }
    if (!has_vertices) return {};
    return plan;
}

std::optional<Plan> plan_npy(ByteSource& in, std::uint64_t size) {
    const NpyHeader header = read_npy_header(in);
    const std::string& type = header.type;
    const bool is_float = type == "<f4" || type == ">f4" || type == "<f8" || type == ">f8";
    if (!is_float || header.fortran_order || header.shape.size() != 2 || header.shape[1] < 3 ||
        header.shape[1] > 0xFFFF)
        return {};
    Plan plan;
    plan.swapped = type[0] == '>';
    const std::size_t bytes = type[2] == '4' ? 4 : 8;
    for (std::size_t d = 0; d < 3; ++d)
        plan.position[d] = {bytes == 4 ? PlyType::f32 : PlyType::f64, d * bytes};
    plan.vertices = {size - in.expected_rest(), header.shape[0], header.shape[1] * bytes};
    if (header.shape[0] > in.expected_rest() / plan.vertices.bytes) return {};
    return plan;
}

Plan plan_rdx(const rdx::MeshPlace& place) {
    Plan plan;
    for (std::size_t d = 0; d < 3; ++d) plan.position[d] = {PlyType::f32, d * sizeof(float)};
    plan.vertices = {place.vertices_begin, place.vertices, sizeof(Vec3)};
    plan.faces = {place.triangles_begin, place.triangles, sizeof(Triangle)};
    plan.counts_corners = false;
    plan.index_type = PlyType::u32;
    return plan;
}

/// The meshes of a file; nothing if it must be read from its beginning.
std::optional<std::vector<Plan>> plans_of(const std::filesystem::path& file) {
    std::string ending = file.extension().string();
    for (char& c : ending) c = c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
    std::vector<Plan> plans;
    if (ending == ".rdx" || is_rdx_file(file)) {
        const auto places = rdx::mesh_places(file);
        if (!places) return {};
        for (const rdx::MeshPlace& place : *places) plans.push_back(plan_rdx(place));
    } else if (ending == ".ply" || ending == ".npy") {
        ByteSource in = ByteSource::from_file(file, Packing::none);
        const std::uint64_t size = in.expected_rest();
        const std::optional<Plan> plan = ending == ".ply" ? plan_ply(in, size) : plan_npy(in, size);
        if (!plan) return {};
        plans.push_back(*plan);
    } else {
        return {};
    }
    for (Plan& plan : plans) plan.file = file;
    return plans;
}

class FileBytes {
public:
    explicit FileBytes(const std::filesystem::path& file)
        : name_(file.string()), in_(file, std::ios::binary) {}

    /// Records [begin, end) of `records`; valid until the next call.
    const char* read(const Records& records, std::uint64_t begin, std::uint64_t end) {
        buffer_.resize((end - begin) * records.bytes);
        in_.seekg(static_cast<std::streamoff>(records.begin + begin * records.bytes));
        if (!in_.read(buffer_.data(), static_cast<std::streamsize>(buffer_.size())))
            throw InputError(name_ + ": cannot be read at byte " +
                             std::to_string(records.begin + begin * records.bytes));
        return buffer_.data();
    }

private:
    std::string name_;
    std::ifstream in_;
    std::vector<char> buffer_;
};

class PartReader {
public:
    explicit PartReader(const Plan& plan)
        : plan_(plan), name_(plan.file.string()), bytes_(plan.file) {}

    /// Points [begin, end), appended.
    void read_points(std::uint64_t begin, std::uint64_t end, std::vector<Vec3>& points) {
        for (std::uint64_t at = begin; at < end;) {
            const std::uint64_t next = std::min(end, at + per_read(plan_.vertices));
            const char* record = bytes_.read(plan_.vertices, at, next);
            for (; at < next; ++at, record += plan_.vertices.bytes)
                points.push_back(point_of(record));
        }
    }

    /// Triangles [begin, end) with indices of the whole file. False if one of these faces is no
    /// triangle.
    bool read_triangles(std::uint64_t begin, std::uint64_t end, std::vector<Triangle>& triangles) {
        const std::size_t count_bytes = plan_.counts_corners ? byte_size(plan_.count_type) : 0,
                          index_bytes = byte_size(plan_.index_type);
        triangles.reserve(end - begin);
        for (std::uint64_t at = begin; at < end;) {
            const std::uint64_t next = std::min(end, at + per_read(plan_.faces));
            const char* record = bytes_.read(plan_.faces, at, next);
            for (; at < next; ++at, record += plan_.faces.bytes) {
                const char* list = record + plan_.list;
                if (plan_.counts_corners &&
                    whole_number(list, plan_.count_type, plan_.swapped) != 3)
                    return false;
                Triangle& triangle = triangles.emplace_back();
                for (std::size_t c = 0; c < 3; ++c)
                    triangle[c] = index_of(list + count_bytes + c * index_bytes, at);
            }
        }
        return true;
    }

    /// The vertices that the triangles use, in their order, and the triangles with new indices.
    /// What lies near each other in the file is read at once.
    void take_vertices(Mesh& mesh) {
        std::vector<std::uint32_t> used;
        used.reserve(3 * mesh.triangles.size());
        for (const Triangle& triangle : mesh.triangles)
            used.insert(used.end(), triangle.begin(), triangle.end());
        std::sort(used.begin(), used.end());
        used.erase(std::unique(used.begin(), used.end()), used.end());
        const std::uint64_t most = per_read(plan_.vertices);
        for (std::size_t k = 0; k < used.size();) {
            const std::uint64_t first = used[k];
            std::size_t end = k + 1;
            while (end < used.size() && used[end] - first < most && used[end] - used[end - 1] < 64)
                ++end;
            const char* records =
                bytes_.read(plan_.vertices, first, std::uint64_t{used[end - 1]} + 1);
            for (; k < end; ++k)
                mesh.vertices.push_back(
                    point_of(records + (used[k] - first) * plan_.vertices.bytes));
        }
        for (Triangle& triangle : mesh.triangles)
            for (std::uint32_t& v : triangle)
                v = static_cast<std::uint32_t>(std::lower_bound(used.begin(), used.end(), v) -
                                               used.begin());
    }

private:
    [[nodiscard]] static std::uint64_t per_read(const Records& records) {
        return std::max<std::uint64_t>(1, (std::uint64_t{1} << 20) / records.bytes);
    }
    [[nodiscard]] Vec3 point_of(const char* record) const {
        const auto along = [&](std::size_t d) {
            return coordinate(record, plan_.position[d], plan_.swapped);
        };
        return without_negative_zero(Vec3{along(0), along(1), along(2)});
    }
    [[nodiscard]] std::uint32_t index_of(const char* at, std::uint64_t face) const {
        const std::uint64_t index = whole_number(at, plan_.index_type, plan_.swapped);
        if (index >= plan_.vertices.count)
            throw InputError(name_ + ": face " + std::to_string(face + 1) + ": vertex " +
                             std::to_string(std::int64_t(index)) + ", but there are " +
                             std::to_string(plan_.vertices.count));
        return static_cast<std::uint32_t>(index);
    }

    const Plan& plan_;
    std::string name_;
    FileBytes bytes_;
};

/// Vertices are named by 32 bits.
bool fits(const Plan& plan) {
    return plan.vertices.count < no_primitive && plan.faces.count < no_primitive;
}

std::string name_of(std::span<const std::filesystem::path> files) {
    std::string name = "load_part";
    for (const std::filesystem::path& file : files) name.append(" ").append(file.string());
    return name;
}

void append(Mesh&& more, Mesh& mesh) {
    if (mesh.vertices.empty()) {
        mesh = std::move(more);
        return;
    }
    if (mesh.vertices.size() + more.vertices.size() >= no_primitive)
        throw InputError("the vertices of this rank's part exceed 2^32");
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), more.vertices.begin(), more.vertices.end());
    for (const Triangle& t : more.triangles)
        mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

/// Elements [begin, end) of one mesh after the others. False if one of these faces is no triangle.
bool append_part(const Plan& plan, bool are_points, std::uint64_t begin, std::uint64_t end,
                 Mesh& mesh) {
    if (begin == end) return true;
    PartReader reader(plan);
    if (are_points) {
        reader.read_points(begin, end, mesh.vertices);
        return true;
    }
    Mesh more;
    if (!reader.read_triangles(begin, end, more.triangles)) return false;
    reader.take_vertices(more);
    append(std::move(more), mesh);
    return true;
}

}  // namespace

std::optional<FilePart> load_part(MPI_Comm given, std::span<const std::filesystem::path> files) {
    const Communicator comm(given);
    std::vector<Plan> plans;
    std::uint64_t is_readable = 1;
    together_on(comm, name_of(files), [&] {
        for (const std::filesystem::path& file : files) {
            const auto of_file = plans_of(file);
            is_readable &= of_file && std::ranges::all_of(*of_file, fits) ? 1u : 0u;
            if (of_file) plans.insert(plans.end(), of_file->begin(), of_file->end());
        }
    });
    FilePart part;
    std::exception_ptr error;
    keep_error(error, [&] {
        if (is_readable == 0) return;
        for (const Plan& plan : plans) {
            part.vertices += plan.vertices.count;
            part.triangles += plan.faces.count;
        }
        const auto rank = std::uint64_t(comm.rank()), ranks = std::uint64_t(comm.size());
        const bool are_points = part.triangles == 0;
        const std::uint64_t n = are_points ? part.vertices : part.triangles;
        std::uint64_t before = 0;  // elements of the meshes before
        for (const Plan& plan : plans) {
            const std::uint64_t count = are_points ? plan.vertices.count : plan.faces.count;
            const auto within = [&](std::uint64_t at) {
                return std::clamp(at, before, before + count) - before;
            };
            if (!append_part(plan, are_points, within(n * rank / ranks),
                             within(n * (rank + 1) / ranks), part.mesh))
                is_readable = 0;
            before += count;
        }
    });
    agree(comm, error);
    comm.reduce(&is_readable, 1, MPI_MIN);
    if (is_readable == 0) return {};
    return part;
}

std::optional<FilePart> load_part(MPI_Comm comm, const std::filesystem::path& file) {
    return load_part(comm, std::span(&file, 1));
}

}  // namespace raydix::mpi
