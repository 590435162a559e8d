// Pictures by all ranks: of a scene that each holds, in parts from a shared counter; or of one that
// is spread over them, whose rays all ranks trace together.
#include <raydix/mpi.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/double3.h"
#include "base/float_env.h"
#include "base/math.h"
#include "exec/parallel.h"
#include "exec/progress.h"
#include "image/picture_parts.h"
#include "image/render_tracers.h"
#include "mpi/agree.h"
#include "mpi/call.h"
#include "mpi/exchange.h"
#include "mpi/scene_internals.h"
#include "mpi/tile_counter.h"
#include "rays/camera_frame.h"

namespace raydix::mpi {
namespace {

constexpr std::uint64_t most_message_bytes = std::uint64_t{1} << 20;
/// Of a part that all ranks trace together: the more, the fewer rounds of messages.
constexpr std::size_t rays_of_rank = std::size_t{1} << 18;
/// Parts for each rank of a picture that is taken from a counter: the more, the less a slow rank
/// keeps the others waiting at the end.
constexpr std::size_t parts_per_rank = 16;

/// Numbers with all their bits.
std::string joined(std::initializer_list<double> numbers) {
    std::string text;
    for (const double x : numbers) text.append(exact_text(x)).append(" ");
    return text;
}

/// What must not differ between ranks.
template <class AnyCamera>
std::string call_text(const AnyCamera& camera, const RenderOptions& options) {
    std::string text = "render from ";
    for (const auto& p : {camera.position, camera.target, camera.up})
        text.append(joined({double(p.x), double(p.y), double(p.z)}));
    text.append("fov ").append(exact_text(double(camera.vfov)));
    text.append(", ").append(view_name(options.view)).append(", ");
    text.append(std::to_string(options.width)).append(" x ").append(std::to_string(options.height));
    text.append(", samples ").append(std::to_string(options.samples)).append(", reach ");
    text.append(exact_text(double(options.ao_radius))).append(", seed ");
    return text.append(std::to_string(options.seed));
}

template <class Box>
std::string box_text(const Box& box) {
    return std::string(", box ").append(
        joined({double(box.lo.x), double(box.lo.y), double(box.lo.z), double(box.hi.x),
                double(box.hi.y), double(box.hi.z)}));
}

/// Pixels that this rank rendered, as it sends them: where they begin, their number, colours.
void put_colours(Bytes& out, std::uint64_t begin, std::span<const Vec3> colours) {
    put(out, begin);
    put(out, std::uint64_t{colours.size()});
    const auto bytes = std::as_bytes(colours);
    out.insert(out.end(), bytes.begin(), bytes.end());
}

/// Collective: the picture on rank 0.
Picture join(const Communicator& comm, const PictureParts& parts, Bytes mine,
             const RenderOptions& options) {
    std::vector<Bytes> out(std::size_t(comm.size()));
    out[0] = std::move(mine);
    const Arrived arrived = exchange(comm, out, most_message_bytes);
    Picture picture;
    together(comm, [&] {
        if (comm.rank() != 0) return;
        picture = {options.width, options.height, {}};
        picture.pixels.resize(parts.pixels().size());
        Reader reader(arrived.all());
        while (!reader.empty()) {
            const auto begin = reader.take<std::uint64_t>();
            const auto count = reader.take<std::uint64_t>();
            for (std::uint64_t i = begin; i < begin + count; ++i)
                picture.pixels[parts.pixels()[i]] = reader.take<Vec3>();
        }
        finish_picture(picture, options.view);
    });
    return picture;
}

/// This rank's pixels, rendered by all its threads.
void take_parts(const Communicator& comm, const PictureParts& parts, TileCounter& counter,
                ProgressListener& listener, Bytes& mine) {
    const std::size_t all = parts.pixels().size(),
                      tile = parts.pixels_of_rays(PictureParts::rays_of_thread),
                      share = all / (std::size_t(comm.size()) * parts_per_rank),
                      step = std::max(tile, share / tile * tile);
    const std::uint64_t steps = (all + step - 1) / step;
    std::vector<Vec3> colours;
    for (std::uint64_t k = counter.take(); k < steps; k = counter.take()) {
        const std::size_t begin = k * step, end = std::min(all, begin + step);
        colours.resize(end - begin);
        for_each_block(end - begin, tile, [&](std::size_t, std::size_t first, std::size_t last) {
            const std::vector<Vec3> some = parts.render(begin + first, begin + last);
            std::copy(some.begin(), some.end(),
                      colours.begin() + static_cast<std::ptrdiff_t>(first));
        });
        put_colours(mine, begin, colours);
        listener.reach(double(end) / double(all));
    }
}

const std::function<void(double)>& progress_of(const Communicator& comm,
                                               const RenderOptions& options) {
    static const std::function<void(double)> none;
    return comm.rank() == 0 ? options.progress : none;
}

Double3 middle_of(const SceneTracer&) { return {}; }
Double3 middle_of(const SceneTracerD& tracer) { return tracer.middle(); }

template <class AnyTracer, class AnyScene, class AnyCamera>
Picture render_replicated(MPI_Comm given, const AnyScene& scene, const AnyCamera& camera,
                          const RenderOptions& options) {
    const FloatEnvironment plain;
    const Communicator comm(given);
    std::optional<AnyTracer> tracer;
    std::optional<PictureParts> parts;
    std::exception_ptr error;
    std::string call = call_text(camera, options);
    keep_error(error, [&] {
        check_render_options(options);
        tracer.emplace(scene);
        call += box_text(scene.bounds());
        const PictureCamera placed = picture_camera(camera, options, middle_of(*tracer));
        with_threads(options.threads, [&] { parts.emplace(*tracer, placed, options); });
    });
    agree_on(comm, call, error);
    Bytes mine;
    ProgressListener listener(progress_of(comm, options));
    {
        TileCounter counter(comm);
        keep_error(error, [&] {
            with_threads(options.threads,
                         [&] { take_parts(comm, *parts, counter, listener, mine); });
        });
        if (error) counter.end();
    }
    agree(comm, error);
    Picture picture = join(comm, *parts, std::move(mine), options);
    together(comm, [&] { listener.finish(); });
    return picture;
}

template <class T>
struct SpaceOfPictures;
template <>
struct SpaceOfPictures<float> {
    explicit SpaceOfPictures(const Aabb& box) : bounds(box) {}
    [[nodiscard]] static std::span<const Ray> rays(std::span<const Ray> given) { return given; }

    Aabb bounds;
    Double3 middle;
};
template <>
struct SpaceOfPictures<double> : SpaceAround {
    explicit SpaceOfPictures(const AabbD& box) : SpaceAround(space_around(box)) {}
    [[nodiscard]] std::vector<RayD> rays(std::span<const Ray> given) const {
        return in_space_around(middle, given);
    }
};

/// Its calls are collective. What they throw is thrown on all ranks.
template <class T>
class DistributedTracer final : public Tracer {
    using Internals = DistributedSceneInternals<T>;

public:
    explicit DistributedTracer(const BasicDistributedScene<T>& scene)
        : scene_(scene), space_(Internals::bounds(scene)) {}

    [[nodiscard]] Aabb bounds() const override { return space_.bounds; }
    [[nodiscard]] Double3 middle() const { return space_.middle; }
    void closest(std::span<const Ray> rays, std::span<Hit> hits,
                 std::span<Double3> normals) const override {
        const auto placed = space_.rays(rays);
        const auto found = on_all([&] { return Internals::trace(scene_, placed, normals); });
        for (std::size_t i = 0; i < found.size(); ++i) {
            const auto& hit = found[i];
            hits[i].t = static_cast<float>(hit.t);
            // Colours of primitives take its lower half, in one process too.
            hits[i].prim = static_cast<std::uint32_t>(hit.prim);
            hits[i].u = static_cast<float>(hit.u);
            hits[i].v = static_cast<float>(hit.v);
            hits[i].geometry = hit.geometry;
            hits[i].instance = hit.instance;
        }
    }
    void occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const override {
        const auto placed = space_.rays(rays);
        const auto answers = on_all([&] { return scene_.trace_any(placed); });
        std::copy(answers.values.begin(), answers.values.end(), found.begin());
    }
    void count_steps(std::span<const Ray>, std::span<std::uint32_t>) const override {
        throw InputError(
            "render: the view steps counts nodes of one scene; this one is spread over ranks");
    }

    /// Whether an error came out of a collective call: then all ranks have it.
    [[nodiscard]] bool failed_on_all() const { return failed_on_all_; }

private:
    template <class Body>
    auto on_all(const Body& body) const {
        try {
            return body();
        } catch (...) {
            failed_on_all_ = true;
            throw;
        }
    }

    const BasicDistributedScene<T>& scene_;
    SpaceOfPictures<T> space_;
    mutable bool failed_on_all_ = false;
};

/// Every rank renders one part of each step, maybe an empty one, so all make the same calls.
void render_shares(const Communicator& comm, const PictureParts& parts, ProgressListener& listener,
                   Bytes& mine) {
    const std::size_t all = parts.pixels().size(), ranks = std::size_t(comm.size()),
                      step =
                          std::min(parts.pixels_of_rays(rays_of_rank), (all + ranks - 1) / ranks);
    for (std::size_t done = 0; done < all; done += step * ranks) {
        const std::size_t begin = std::min(all, done + step * std::size_t(comm.rank())),
                          end = std::min(all, begin + step);
        put_colours(mine, begin, parts.render(begin, end));
        listener.reach(double(std::min(all, done + step * ranks)) / double(all));
    }
}

template <class T, class AnyCamera>
Picture render_distributed(const BasicDistributedScene<T>& scene, const AnyCamera& camera,
                           const RenderOptions& options) {
    const FloatEnvironment plain;
    const Communicator& comm = DistributedSceneInternals<T>::communicator(scene);
    const DistributedTracer<T> tracer(scene);
    PictureCamera placed;
    together_on(comm, call_text(camera, options), [&] {
        check_render_options(options);
        if (options.view == View::steps) tracer.count_steps({}, {});
        placed = picture_camera(camera, options, tracer.middle());
    });
    std::optional<PictureParts> parts;
    Bytes mine;
    ProgressListener listener(progress_of(comm, options));
    std::exception_ptr error;
    keep_error(error, [&] {
        parts.emplace(tracer, placed, options);
        render_shares(comm, *parts, listener, mine);
    });
    if (tracer.failed_on_all()) std::rethrow_exception(error);
    // The others get it here, or in the call that they wait in.
    agree_on(comm, "render", error);
    Picture picture = join(comm, *parts, std::move(mine), options);
    together(comm, [&] { listener.finish(); });
    return picture;
}

}  // namespace

Picture render(MPI_Comm comm, const Scene& scene, const Camera& camera,
               const RenderOptions& options) {
    return render_replicated<SceneTracer>(comm, scene, camera, options);
}

Picture render(MPI_Comm comm, const SceneD& scene, const CameraD& camera,
               const RenderOptions& options) {
    return render_replicated<SceneTracerD>(comm, scene, camera, options);
}

Picture render(const DistributedScene& scene, const Camera& camera, const RenderOptions& options) {
    return render_distributed(scene, camera, options);
}

Picture render(const DistributedSceneD& scene, const CameraD& camera,
               const RenderOptions& options) {
    return render_distributed(scene, camera, options);
}

}  // namespace raydix::mpi
