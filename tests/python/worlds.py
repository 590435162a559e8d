"""Scenes and the same once more as plain data, to look at every triangle."""

import numpy as np
import support

import raydix

BOX = support.box_mesh([-1, -2, -3], [1, 2, 3])
DOWN = [0, 0, 9, 0, 0, -1]
ALL = 0xFFFFFFFF


def transform(rng, mirror=False, shear=0.0):
    """A turn, a size, a shear and a move: (3, 4) float32."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    if (np.linalg.det(turn) < 0) != mirror:
        turn[:, 0] *= -1
    slide = np.eye(3)
    slide[0, 1] = shear
    linear = turn @ slide @ np.diag(rng.uniform(0.5, 1.5, 3))
    return np.concatenate([linear, rng.uniform(-2, 2, (3, 1))], axis=1).astype(np.float32)


class World:
    """A scene, and the same once more as plain data, to look at every triangle."""

    def __init__(self, **options):
        self.scene = raydix.Scene(**options)
        self.parts = {}  # id -> (mask, vertices, faces) or (mask, transform, world)

    def add_mesh(self, vertices, faces, mask=ALL, **options):
        id = self.scene.add(vertices, faces, mask=mask, **options)
        self.parts[id] = (mask, vertices, faces)
        return id

    def add_instance(self, world, place, mask=ALL, **options):
        id = self.scene.add(world.scene, place, mask=mask, **options)
        self.parts[id] = (mask, place, world)
        return id

    def flat(self):
        """(path, instance, geometry, masks on the way, vertices in float64, faces), and how many
        paths."""
        found, paths = [], 0
        for id in sorted(self.parts):
            mask, what, below = self.parts[id]
            if not isinstance(below, World):
                found.append(([], 0, id, [mask], what.astype(np.float64), below))
                continue
            first = paths + 1
            inner, more = below.flat()
            paths += 1 + more
            what = np.float64(what)
            for path, instance, geometry, masks, vertices, faces in inner:
                moved = vertices @ what[:, :3].T + what[:, 3]
                found.append(
                    ([id, *path], first + instance, geometry, [mask, *masks], moved, faces)
                )
        return found, paths

    def hits(self, rays, masks):
        """t of every triangle for every ray, infinity where there is no hit, and what each
        triangle is: (instance, geometry, prim)."""
        times, names = [], []
        for _, instance, geometry, on_way, vertices, faces in self.flat()[0]:
            t = support.brute_force_hits(vertices, faces, rays)
            seen = np.logical_and.reduce([(masks & mask) != 0 for mask in on_way])
            times.append(np.where(seen[:, None], t, np.inf))
            names += [(instance, geometry, prim) for prim in range(len(faces))]
        return np.concatenate(times, axis=1), np.array(names)


def triangles(rng, count, size=0.6):
    return support.random_triangles(rng, count, size)


def random_world(rng, **options):
    """Meshes and instances on three levels, some mirrored, some sheared, some behind masks."""
    leaf = World(**options)
    leaf.add_mesh(*triangles(rng, 12))
    leaf.add_mesh(*triangles(rng, 9), mask=0b0111, id=4)
    leaf.scene.commit()
    middle = World(**options)
    middle.add_instance(leaf, transform(rng, mirror=True))
    middle.add_mesh(*triangles(rng, 7))
    middle.add_instance(leaf, transform(rng, shear=0.7), mask=0b1101)
    middle.scene.commit()
    world = World(**options)
    world.add_instance(middle, transform(rng), mask=0b1110)
    world.add_mesh(*triangles(rng, 15))
    world.add_instance(leaf, transform(rng, mirror=True, shear=-0.4))
    world.add_instance(middle, transform(rng, mirror=True))
    world.add_mesh(*triangles(rng, 5), mask=0b0010)
    return world


def same_hits(found, wanted):
    for name, values in wanted.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)


def same_names(hits, clear, best):
    """The hits that are `clear` name what `best` does: rows of instance, geometry, prim. Misses
    name nothing."""
    for i, name in enumerate(("instance", "geometry", "prim")):
        np.testing.assert_array_equal(hits[name][clear], best[clear, i])
        assert hits[name].dtype == np.uint32
    miss = hits["prim"] == raydix.MISSING
    assert set(hits["instance"][miss]) <= {0}
    assert set(hits["geometry"][miss]) <= {raydix.MISSING}
