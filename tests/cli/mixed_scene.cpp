// mixed_scene FILE: saves a scene of one mesh and a sphere, which no command of the program makes.
#include <raydix/rdx_scene.h>
#include <raydix/scene.h>

#include <vector>

int main(int count, char** arguments) {
    if (count != 2) return 2;
    const std::vector<raydix::Vec3> corners{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}};
    const std::vector<raydix::Triangle> triangles{{0, 1, 2}};
    const std::vector<raydix::Sphere> spheres{{{5, 0, 0}, 1}};
    raydix::Scene scene;
    scene.add(raydix::MeshView{corners, triangles});
    scene.add(std::span<const raydix::Sphere>(spheres));
    scene.commit();
    raydix::save_rdx(arguments[1], scene, "mixed");
}
