#include "support/exact.h"

namespace raydix::test {

ExactPoint exact(Vec3d p) { return {Exact(p.x), Exact(p.y), Exact(p.z)}; }
ExactPoint operator-(const ExactPoint& a, const ExactPoint& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
Exact dot(const ExactPoint& a, const ExactPoint& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
ExactPoint cross(const ExactPoint& a, const ExactPoint& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

}  // namespace raydix::test
