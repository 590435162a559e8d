#include "support/oracle.h"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <sstream>

namespace raydix::test {
namespace {

struct D3 {
    double x, y, z;
};
D3 to_double(const Vec3& p) { return {p.x, p.y, p.z}; }
D3 minus(const D3& a, const D3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
double inner(const D3& a, const D3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
D3 outer(const D3& a, const D3& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double norm(const D3& a) { return std::hypot(a.x, a.y, a.z); }
double largest(const D3& a) { return std::max({std::abs(a.x), std::abs(a.y), std::abs(a.z)}); }

bool counts(const Vec3& p) {
    return std::abs(p.x) <= 1e12f && std::abs(p.y) <= 1e12f && std::abs(p.z) <= 1e12f;
}

struct Corners {
    Vec3 a, b, c;
};
Corners corners(const MeshView& mesh, std::uint32_t prim) {
    const Triangle& t = mesh.triangles[prim];
    return {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
}

/// A claimed hit, measured. A ray along the triangle's plane has no t of its own: the claimed one
/// stands for it.
struct Claim {
    OracleHit exact;
    OracleSlack slack;
    double to_edges;

    [[nodiscard]] bool near_edge() const { return to_edges <= slack.across; }
    [[nodiscard]] bool plausible() const { return exact.inside() || near_edge(); }
    [[nodiscard]] bool near_limit(const Ray& ray) const {
        const double start = std::max(0.0f, ray.tmin);
        return std::abs(exact.t - start) <= slack.t ||
               std::abs(exact.t - double(ray.tmax)) <= slack.t;
    }
};

Claim measure(const MeshView& mesh, const Ray& ray, const Hit& hit) {
    const Corners t = corners(mesh, hit.prim);
    Claim claim{oracle_intersect(t.a, t.b, t.c, ray), oracle_slack(t.a, t.b, t.c, ray),
                distance_to_edges(t.a, t.b, t.c, ray)};
    if (!claim.exact.valid) claim.exact.t = hit.t;
    return claim;
}

/// The exact t judges, not the other's: the other may be farther off than we are.
Verdict judge_same(const Claim& claim, const Hit& ours) {
    const bool near = std::abs(double(ours.t) - claim.exact.t) <= claim.slack.t;
    return claim.plausible() && near ? Verdict::exact : Verdict::wrong;
}

std::string describe(const MeshView& mesh, const Ray& ray, const Hit& ours, const Hit& other) {
    std::ostringstream out;
    out.precision(9);
    out << "  origin " << ray.origin.x << " " << ray.origin.y << " " << ray.origin.z
        << " direction " << ray.direction.x << " " << ray.direction.y << " " << ray.direction.z
        << " t in [" << ray.tmin << ", " << ray.tmax << "]";
    for (const Hit& hit : {ours, other}) {
        out << ";"
            << " hit " << hit.prim << " at " << hit.t;
        if (!hit.hit()) continue;
        const Claim claim = measure(mesh, ray, hit);
        out << " (exact " << claim.exact.t << " +- " << claim.slack.t << ", from its edges "
            << claim.to_edges << " +- " << claim.slack.across << ")";
    }
    out << "\n";
    return out.str();
}

}  // namespace

bool has_area(const Vec3& v0, const Vec3& v1, const Vec3& v2) {
    const D3 normal =
        outer(minus(to_double(v1), to_double(v0)), minus(to_double(v2), to_double(v0)));
    return normal.x != 0 || normal.y != 0 || normal.z != 0;
}

OracleHit oracle_intersect(const Vec3& v0, const Vec3& v1, const Vec3& v2, const Ray& ray) {
    const D3 origin = to_double(ray.origin), d = to_double(ray.direction);
    const D3 ab = minus(to_double(v1), to_double(v0)), ac = minus(to_double(v2), to_double(v0));
    if (!has_area(v0, v1, v2)) return {};
    const D3 p = outer(d, ac);
    const double determinant = inner(ab, p);
    if (determinant == 0) return {};
    const D3 s = minus(origin, to_double(v0)), q = outer(s, ab);
    return {inner(ac, q) / determinant, inner(s, p) / determinant, inner(d, q) / determinant, true};
}

OracleSlack oracle_slack(const Vec3& v0, const Vec3& v1, const Vec3& v2, const Ray& ray) {
    const D3 origin = to_double(ray.origin), d = to_double(ray.direction);
    const D3 a = to_double(v0), b = to_double(v1), c = to_double(v2);
    const double reach =
        std::max({largest(minus(a, origin)), largest(minus(b, origin)), largest(minus(c, origin))});
    const double off = 32 * 0x1p-24 * reach;  // lateral error of a vertex as a float test sees it
    const D3 normal = outer(minus(b, a), minus(c, a));
    const double across = std::abs(inner(normal, d));  // 0: the ray lies along the plane
    const double longest = std::max({norm(minus(b, a)), norm(minus(c, b)), norm(minus(a, c))});
    // A float test interpolates t from the corners, so what u and v are off counts once more, over
    // the part of the ray beside the triangle: for slivers that is most of it.
    const auto along = [&](const D3& p) { return inner(minus(p, origin), d) / inner(d, d); };
    const auto [first, last] = std::minmax({along(a), along(b), along(c)});
    const double edge = off * longest * norm(d) / across;
    return {off, off * norm(normal) / across + edge * (last - first), edge};
}

double distance_to_edges(const Vec3& v0, const Vec3& v1, const Vec3& v2, const Ray& ray) {
    const D3 origin = to_double(ray.origin), d = to_double(ray.direction);
    const auto across = [&](const D3& p) {  // the part of p at right angles to the ray
        const double along = inner(p, d) / inner(d, d);
        return D3{p.x - along * d.x, p.y - along * d.y, p.z - along * d.z};
    };
    double nearest = HUGE_VAL;
    const D3 p[] = {to_double(v0), to_double(v1), to_double(v2)};
    for (int k = 0; k < 3; ++k) {
        const D3 a = across(minus(p[k], origin)), e = across(minus(p[(k + 1) % 3], p[k]));
        const double square = inner(e, e);
        const double s = square > 0 ? std::clamp(-inner(a, e) / square, 0.0, 1.0) : 0.0;
        nearest = std::min(nearest, norm({a.x + s * e.x, a.y + s * e.y, a.z + s * e.z}));
    }
    return nearest;
}

Hit oracle_closest(const MeshView& mesh, const Ray& ray) {
    Hit best;
    double nearest = ray.tmax;
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        const Corners t = corners(mesh, i);
        if (!counts(t.a) || !counts(t.b) || !counts(t.c)) continue;
        const OracleHit hit = oracle_intersect(t.a, t.b, t.c, ray);
        if (!hit.inside() || hit.t < std::max(0.0f, ray.tmin) || hit.t > nearest) continue;
        if (hit.t == nearest && best.hit()) continue;
        nearest = hit.t;
        best = hit_of_tree(
            {static_cast<float>(hit.t), i, static_cast<float>(hit.u), static_cast<float>(hit.v)});
    }
    return best;
}

Verdict judge(const MeshView& mesh, const Ray& ray, const Hit& ours, const Hit& other) {
    if (ours.hit() && other.hit() && ours.prim == other.prim)
        return judge_same(measure(mesh, ray, ours), ours);
    if (ours.hit() && other.hit()) {
        const Claim a = measure(mesh, ray, ours), b = measure(mesh, ray, other);
        if (!a.plausible()) return Verdict::wrong;
        const bool close = !(std::abs(a.exact.t - b.exact.t) > a.slack.t + b.slack.t);
        if (close && b.plausible()) return Verdict::tie;
        // The nearer of the two was missed by the other side: only an edge or a limit excuses it.
        const Claim& nearer = a.exact.t < b.exact.t ? a : b;
        return nearer.near_edge() || nearer.near_limit(ray) || !b.plausible() ? Verdict::grazing
                                                                              : Verdict::wrong;
    }
    if (!ours.hit() && !other.hit()) return Verdict::exact;
    const Claim only = measure(mesh, ray, ours.hit() ? ours : other);
    if (ours.hit() && !only.plausible()) return Verdict::wrong;
    return only.near_edge() || only.near_limit(ray) || !only.plausible() ? Verdict::grazing
                                                                         : Verdict::wrong;
}

Tally compare(const MeshView& mesh, std::span<const Ray> rays, std::span<const Hit> ours,
              std::span<const Hit> others) {
    Tally tally;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        ++tally.rays;
        if (ours[i].hit()) ++tally.hits;
        if (!ours[i].hit() && !others[i].hit()) {
            ++tally.both_miss;
            continue;
        }
        switch (judge(mesh, rays[i], ours[i], others[i])) {
            case Verdict::exact:
                ++tally.exact;
                break;
            case Verdict::tie:
                ++tally.ties;
                break;
            case Verdict::grazing:
                ++tally.grazing;
                break;
            case Verdict::wrong:
                if (++tally.wrong <= 5)
                    tally.first_wrong += describe(mesh, rays[i], ours[i], others[i]);
                break;
        }
    }
    return tally;
}

std::ostream& print_line(std::ostream& out, const std::string& scene, const std::string& peer,
                         const Tally& tally) {
    return out << scene << " against " << peer << ": " << tally.rays << " rays, " << tally.hits
               << " hits, " << tally.exact << " exact, " << tally.ties << " ties, "
               << tally.both_miss << " both missed, " << tally.grazing << " grazing, "
               << tally.wrong << " wrong\n"
               << tally.first_wrong;
}

}  // namespace raydix::test
