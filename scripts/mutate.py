#!/usr/bin/env python3
"""scripts/mutate.py [NUMBER...]: plants small faults in the core, one at a time, and lists those that no test notices.
scripts/mutate.py --commit-results: writes what the last run of each fault gave to bench/results/mutations.json.

Works on a copy of the tree in build/mutate. A fault is noticed if something no longer builds, or if a test program
fails, crashes or runs out of time: first those of `tests`, then all others; of each, tests that take long last. Exit
code 1 if a fault goes unnoticed or no longer applies (its old text must stand exactly once in the file).
"""
import dataclasses
import fcntl
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORK = ROOT / "build" / "mutate"
SOURCE, BUILD = WORK / "source", WORK / "build"
RESULTS, COMMITTED = WORK / "results.json", ROOT / "bench" / "results" / "mutations.json"
LEAST_TIME_LIMIT_S = 60
JOBS = os.environ.get("RAYDIX_JOBS", str(os.cpu_count() or 1))
MPIRUN = ["mpirun", "--oversubscribe", "--bind-to", "none", "--mca", "mpi_yield_when_idle", "1",
          *(["--allow-run-as-root"] if os.geteuid() == 0 else []), "-n", "4"]


# Tests of a folder that take more than a second each, together minutes: only what the others let pass is put to them.
LONG = {
    "trace": ("Hits.BuiltinScenesLikeBruteForce", "Hits.SoupsLikeBruteForce", "Hits.LeafSizeAndCodeBitsChangeNoBit",
              "Hits.SoupAgainstEveryTriangle", "Hits.FaultResultsDifferByThreadCount", "Simd.SoupsLikeScalar",
              "Simd.BuiltinScenesLikeScalar", "Simd.EveryBuilderAndLeafSize", "Simd.LimitsBesideTheHit",
              "Simd.NoRayLeavesAClosedSurface", "KdRays.SoupsLikeBruteForce", "KdRays.BuiltinScenesLikeBruteForce",
              "KdRays.SharedBunnyLikeTheBvh", "KdNearest.LikeEveryPoint", "Watertight.*", "DoubleWatertight.*",
              "CwbvhTrace.SoupsLikeScalar", "CwbvhTrace.BuiltinScenesLikeScalar", "OracleHits.BuiltinScenes*",
              "DoubleTrace.EveryBuilderLikeEveryTriangle", "DoubleTrace.PartsOfTrianglesChangeNoBit",
              "DoubleTrace.ThreadsLeavesAndCodesChangeNoBit", "DoubleTrace.TIsThatOfExactArithmetic",
              "RayFaults.GpsCoordinatesCollapseCodes", "Simulate.FiguresDoNotDependOnThreads"),
    "engine": ("*WorldsAnswerAsTheirTrianglesDo", "DoubleMesh.AtAnyPlaceHasTheHitsOfAllTriangles",
               "DoubleMesh.OfAnyShapeHasTheHitsOfAllTriangles", "*ShearedInstancesLoseNoHits",
               "*MixedScenesAnswerAsEachShapeDoes", "*MovedVerticesRefitATreeWhileItIsGood",
               "*AnswersAreThoseOfEveryMeshOnEveryPath", "InstanceEdges.NearlyFlatMaps",
               "SceneProgress.ACommitThatEndsAtAnyCallLeavesTheSceneAsItWas"),
}


@dataclasses.dataclass(frozen=True)
class Fault:
    file: str
    old: str
    new: str
    breaks: str
    tests: str  # folders of tests/, those most likely to notice first


FAULTS = [
    Fault("src/keys/morton.h",
          "return spread_bits(Key{c.x}) << 2 | spread_bits(Key{c.y}) << 1 |",
          "return spread_bits(Key{c.y}) << 2 | spread_bits(Key{c.x}) << 1 |",
          "codes: x is not the highest bit of a triple", "keys device tree"),
    Fault("src/keys/host_encode.h", "return x << 2 | y << 1 |", "return y << 2 | x << 1 |",
          "63-bit codes of the host: axes exchanged", "keys device tree"),
    Fault("src/keys/morton.h", "Grid grid{scene.lo, 0.0f, cells - 1.0f};", "Grid grid{scene.lo, 0.0f, cells};",
          "codes: the upper face of the scene lies in a cell past the last", "keys device tree"),
    Fault("src/primitives/host_box.h", "largest_magnitude(a, b, c)", "largest_magnitude(a, b, b)",
          "boxes of the host: the third corner may be anything", "device primitives build"),
    Fault("src/sort/radix_sort.cpp", "a[k - 1].key > moving.key", "a[k - 1].key >= moving.key",
          "sort: equal keys change their order", "sort tree device"),
    Fault("src/sort/radix_sort.cpp", "if (end - begin > 1) sort_alone(", "if (end - begin > 2) sort_alone(",
          "sort: pairs that agree in two digits stay as they were", "sort tree device"),
    Fault("src/tree/radix_tree.h",
          "leading_zeros(static_cast<std::uint32_t>(i) ^ static_cast<std::uint32_t>(j));",
          "leading_zeros(static_cast<std::uint32_t>(i) - static_cast<std::uint32_t>(j));",
          "hierarchy: equal codes are told apart wrongly", "tree device"),
    Fault("src/tree/radix_tree.h", "range.last, range.split + 1);", "range.last, range.split);",
          "hierarchy: the right child gets the left one's index", "tree device"),
    Fault("src/tree/radix_tree.h", "if (count <= max_leaf) {", "if (count < max_leaf) {",
          "collapse: a subtree of exactly max_leaf keys is no leaf", "tree"),
    Fault("src/tree/karras.cpp", "if (length == scan_limit) return find_range(keys, node);\n        last",
          "if (length > scan_limit) return find_range(keys, node);\n        last",
          "hierarchy: long ranges end where the scan gave up", "tree device"),
    Fault("src/tree/fit.h", "unite(box_of(pair[0]), box_of(pair[1])));", "unite(box_of(pair[0]), box_of(pair[0])));",
          "boxes: the right child is left out", "tree device"),
    Fault("src/tree/fit.h", "(height > other - 1u ? height : other - 1u);", "height;",
          "depth: only the last child to arrive counts", "tree device"),
    Fault("src/tree/karras_launches.h", "const int outside = behind > before ? before : behind;", "const int outside = behind > before ? behind : before;",
          "karras as launches: a node's range must exceed its own neighbour's prefix", "tree"),
    Fault("src/tree/karras_launches.h", "behind > before ? i + reach : i - reach;", "behind > before ? i + reach - 1 : i - reach;",
          "karras as launches: nodes of exactly max_leaf keys are kept", "tree"),
    Fault("src/tree/lbvh_launches.h", "keys.common_prefix(first, middle) > shared)", "keys.common_prefix(first, middle) >= shared)",
          "garanzha: a range is split at its last key", "tree"),
    Fault("src/tree/karras_published.h", "child(pair_slot(node) + 1, range.split + 1, range.split + 1 == range.last);",
          "child(pair_slot(node) + 1, range.split + 1, range.split == range.last);",
          "karras as published: a right child of one key is no leaf", "tree"),
    Fault("src/tree/garanzha_published.h", "const bool split_right = range.last - split > max_leaf;",
          "const bool split_right = range.last - split >= max_leaf;",
          "garanzha as published: a right child of max_leaf keys is split", "tree"),
    Fault("src/exec/host_launcher.h", "Probe::bytes((end - begin) * 2 * pair_bytes);\n                          Probe::steps",
          "Probe::bytes((end - begin) * pair_bytes);\n                          Probe::steps",
          "the sort counts what it reads and not what it writes", "build"),
    Fault("src/measure/launch_model.cpp", "std::clamp(double(launch.items), 1.0, factor)", "factor",
          "the model shares a launch of few items among more threads", "build"),
    Fault("src/tree/garanzha.h", "if (right && task.split - task.first >= max_leaf) ++place;", "",
          "garanzha: both children of a task get the same place in the queue", "tree"),
    Fault("src/tree/garanzha.h", "if (last - first < max_leaf) {", "if (last - first <= max_leaf) {",
          "garanzha: a child of max_leaf + 1 keys is no longer split", "tree"),
    Fault("src/tree/lauterbach.h", "link_inner(out.nodes[slot], rank);", "link_inner(out.nodes[slot], rank + 1);",
          "lauterbach: a node leads to the children of the next", "tree"),
    Fault("src/tree/lauterbach.h", "child(pair_slot(rank), node.first, split);", "child(pair_slot(rank), node.first, split - 1);",
          "lauterbach: left children end a key too early", "tree"),
    Fault("src/tree/lauterbach.h", "is_new && node.last - node.first >= max_leaf", "(is_new || k > 0) && node.last - node.first >= max_leaf",
          "lauterbach: nodes with one child are not removed", "tree"),
    Fault("src/tree/lauterbach.h", "0 : 32 - static_cast<int>(index_bits);", "0 : 0;",
          "lauterbach: equal codes divide on levels that there are not", "tree"),
    Fault("src/tree/lauterbach.cpp", "needed(width) > memory_limit)\n        throw", "needed(width) > 2 * memory_limit)\n        throw",
          "lauterbach: takes more memory than it may", "tree"),
    Fault("src/tree/apetrei_cpu.h", "if (prefix > left_border) {", "if (true) {",
          "apetrei by runs: nodes that reach over the left end of a run are taken for its own", "tree"),
    Fault("src/tree/apetrei_cpu.h", "nominal == 0 || nominal >= n ? std::min(nominal, n) : next_kept(nominal - 1) + 1;", "std::min(nominal, n);",
          "apetrei by runs: a run begins inside a leaf", "tree"),
    Fault("src/tree/apetrei_cpu.h", "1 + std::max(left->subtree.height, right.height)", "1 + right.height",
          "apetrei by runs: only the right child's height counts", "tree"),
    Fault("src/tree/kept_splits.cpp", "const int limit = max_leaf - 1;", "const int limit = max_leaf > 1 ? max_leaf - 2 : 0;",
          "kept splits: nodes of exactly max_leaf keys are kept", "tree"),
    Fault("src/sort/radix_sort.cpp", "f(Record<Key>{batch[k], static_cast<std::uint32_t>(i + k)});", "f(Record<Key>{batch[k], static_cast<std::uint32_t>(i)});",
          "sort: keys of a batch all come from its first place", "sort"),
    Fault("src/keys/host_encode.h", "third << 2) | _pdep_u64(xy >> 32, third << 1)", "third << 1) | _pdep_u64(xy >> 32, third << 2)",
          "codes by deposited bits: x and y exchanged", "device"),
    Fault("src/measure/launch_model.cpp", "std::max({work_ns, bytes_ns, chain_ns})", "std::max({work_ns, bytes_ns})",
          "launch model: chains take no time", "build"),
    Fault("src/tree/apetrei.h", "const bool is_left = behind > before;", "const bool is_left = behind < before;",
          "apetrei: the parent takes in the neighbour that shares less", "tree"),
    Fault("src/tree/apetrei.h", "kept[s] = left + right > max_leaf ? 1 : 0;", "kept[s] = left + right >= max_leaf ? 1 : 0;",
          "apetrei: nodes of exactly max_leaf keys are kept", "tree"),
    Fault("src/tree/apetrei.h", "unite(box_of(node), box_of(out.nodes[sibling]))", "box_of(out.nodes[sibling])",
          "apetrei: the box of the child that came second is left out", "tree"),
    Fault("src/tree/fit_levels.h", "1 + (left > right ? left : right);", "1 + (left < right ? left : right);",
          "boxes by levels: the shallower child decides the depth", "tree"),
    Fault("src/tree/fit_levels.h", "if (left) ranks[place++] = rank_of_slot(pair[0].first);", "if (left) ranks[place] = rank_of_slot(pair[0].first);",
          "levels from the root: two children in one place", "tree"),
    Fault("src/tree/device_key_count.h", "values[*exact + i] = 0;", "static_cast<void>(i);",
          "builds of a device: scans see what lies behind the last key", "gpu"),
    Fault("src/tree/tree_launches.h", "if (n <= max_leaf) EmitOnlyLeaf", "if (n < max_leaf) EmitOnlyLeaf",
          "builds of a device: exactly max_leaf valid keys are no leaf", "gpu"),
    Fault("src/tree/garanzha.h", "level == 0 && key_count > max_leaf ? 1 : 0;", "level == 0 ? 1 : 0;",
          "garanzha: a task for keys that fit into one leaf", "gpu"),
    Fault("src/primitives/bounds_launches.h", "        valid += o.valid;\n", "",
          "bounds as launches: the valid ones are not counted", "gpu"),
    Fault("src/layout/pair64.h", "ids[last] = order[last] | last_in_leaf;", "ids[last] = order[last];",
          "node pairs: a leaf's list has no end", "gpu trace"),
    Fault("src/tree/counted_builds.cpp", "fits_by_levels({.builder = way.builder, .fit = way.fit});", "!fits_by_levels({.builder = way.builder, .fit = way.fit});",
          "counted builds: the two fits exchanged", "tree"),
    Fault("src/tree/cluster.h", "return (i & (d & (0u - d))) == 0;", "return (i & d) == 0;",
          "clusters: a tie is broken differently from both ends of a pair", "tree"),
    Fault("src/tree/cluster.h", "if (as_leaf <= sum.cost) {", "if (as_leaf < sum.cost) {",
          "clusters: a leaf that costs as much as its subtree is not taken", "tree"),
    Fault("src/tree/nearest_cluster.cpp", "std::int64_t{begin} - 2 * reach;", "std::int64_t{begin} - reach;",
          "ploc: a block does not see all that its partners see", "tree"),
    Fault("src/tree/split_bins.cpp", "here < cost;", "here <= cost;",
          "binned: of equal planes the last one is taken", "tree"),
    Fault("src/tree/split_bins.cpp", "if (found.cost[axis] == 0) return most_even();", "",
          "binned: boxes without area are divided unevenly", "tree"),
    Fault("src/tree/sweep_split.cpp", "unevenness(left, n) < unevenness(best.left, n)) {", "false) {",
          "sweep: equal cuts are not taken evenly", "tree"),
    Fault("src/tree/sah_subtree.cpp", "if (as_leaf <= below.cost) {", "if (as_leaf < below.cost) {",
          "sweep: a leaf that costs as much as its subtree is not taken", "tree"),
    Fault("src/tree/sah_subtree.cpp", "std::unique(ids, end) - ids);", "end - ids);",
          "split trees: a leaf holds two parts of one triangle", "tree"),
    Fault("src/tree/sbvh_build.cpp", "if (count > max_leaf_ || !(as_leaf <= below.cost)) return below;",
          "if (count > max_leaf_ || !(as_leaf < below.cost)) return below;",
          "sbvh: a leaf that costs as much as its subtree is not taken", "tree"),
    Fault("src/tree/spatial_split.cpp", "        before.add(inside(triangle.section(hi)));", "",
          "sbvh: the last slice of a triangle ends at the plane before it", "tree"),
    Fault("src/tree/spatial_split.cpp", "rows_[static_cast<std::size_t>(to[axis])].ends[axis] += stands_for;",
          "first.ends[axis] += stands_for;", "sbvh: a triangle across a plane counts on one side", "tree"),
    Fault("src/tree/outward_box.h", "std::nextafterf(rounded, -infinity))", "rounded)",
          "split trees: boxes of parts are not rounded outward", "tree"),
    Fault("src/trace/all_hits.h", "{ return a.prim == b.prim; }),", "{ return &a == &b; }),",
          "all hits: a triangle in two leaves is hit twice", "tree"),
    Fault("src/tree/climb_warps.h", "before != lane && (lefts >> before & 1) != 0;", "(lefts >> before & 1) != 0;",
          "a climb in warps: a left child with nothing before it passes for a right one", "gpu"),
    Fault("src/tree/climb_warps.h", "height = 1 + larger(height, other - 1);", "height = 1 + height;",
          "a climb in warps: the depth is that of the second child to arrive", "gpu"),
    Fault("src/primitives/bounds_launches.h", "for (std::uint64_t k = place; k < n; k += tiles * warp_lanes)",
          "for (std::uint64_t k = place; k < n && k < tiles * warp_lanes; k += tiles * warp_lanes)",
          "bounds on a device: only the first primitive of each lane counts", "primitives"),
    Fault("src/layout/leaf_copies.h", "(left < warp_lanes ? left : warp_lanes);", "(left < 1 ? left : warp_lanes);",
          "leaf copies of a device: the last warp writes behind the array", "gpu"),
    Fault("src/tree/hploc.h", "split_[lane] = last_[lane] + 1;", "split_[lane] = last_[lane];",
          "hploc: children that meet in a warp are divided one key too early", "gpu"),
    Fault("src/tree/hploc.h", "lane - left + hploc_list;", "lane - left + hploc_list - 1;",
          "hploc: the right child's list is read one place too early", "tree"),
    Fault("src/layout/leaf_order.h", "k < first + count; ++k)", "k + 1 < first + count; ++k)",
          "boxes: a leaf's last primitive is left out", "layout tree"),
    Fault("src/trace/host_slabs.h", "_mm_max_ps(plane(_mm_movelh_ps(near_z, far_z), 2), t);",
          "_mm_max_ps(t, plane(_mm_movelh_ps(near_z, far_z), 2));",
          "slab test: rays that lie in a slab plane are lost", "device trace"),
    Fault("src/trace/slab.h", "inline constexpr float slab_pad = slab_pad_of<float>;",
          "inline constexpr float slab_pad = 0.0f;",
          "slab test: boxes are not widened, rays slip between triangles", "trace build device"),
    Fault("src/trace/triangle_test.h", "if (su != sv || sv != sw) return false;", "if (su != sv && sv != sw) return false;",
          "all hits: an edge may belong to both of its triangles", "trace device"),
    Fault("src/trace/triangle_test.h", "v = edge_function(a, c), w", "v = edge_function(c, a), w",
          "triangle test: one edge turned round", "trace build device"),
    Fault("src/trace/ray_frame.h", "ray.tmin <= ray.tmax && ray.tmax >= 0;",
          "ray.tmin <= ray.tmax && ray.tmin >= 0;", "rays that start behind their origin are misses",
          "trace"),
    Fault("src/trace/tree_hits.h", "tree.order[k] < best.prim)", "tree.order[k] > best.prim)",
          "closest hit: ties go to the higher id", "trace device"),
    Fault("src/trace/brute_force.cpp", "if (hit.t < best.t || !best.hit())", "if (hit.t <= best.t || !best.hit())",
          "brute force: ties go to the higher id", "trace device"),
    Fault("src/trace/walk.h", "} while (top->entry > reach());", "} while (top->entry >= reach());",
          "walk: a node that begins at the best t is skipped, so ties are lost", "trace device"),
    Fault("src/tree/stats.cpp", "cost.primitive * node.count : cost.node;", "cost.primitive : cost.node;",
          "SAH: a leaf costs as much as one primitive", "tree"),
    Fault("src/tree/epo.cpp", "(2 * i + 1) * n / (2 * sampled);", "i * n / (2 * sampled);",
          "EPO: only the first half of the triangles is looked at", "tree"),
    Fault("src/tree/hash.cpp", "        hash.put(node.hi);\n", "", "tree hash: upper corners do not enter", "tree"),
    Fault("src/tree/validate.cpp", "        if (used_[first / 2])\n", "        if (false)\n",
          "check: a subtree may hang below two nodes, or below itself", "tree build io"),
    Fault("src/tree/split_plane.h", "cell >> bits_below << bits_below)};", "cell)};",
          "k-d tree: planes lie at the first code of the right side", "tree"),
    Fault("src/tree/split_plane.h", "if (prefix >= CodeFormat<Key>::bits) return {axis, infinity};",
          "if (prefix >= CodeFormat<Key>::bits) return {0u, infinity};",
          "k-d tree: splits of equal codes stay on one axis", "tree"),
    Fault("src/tree/kdtree.h", "scratch.boxes[slot] = unite(scratch.boxes[pair], scratch.boxes[pair + 1]);",
          "scratch.boxes[slot] = unite(scratch.boxes[pair], scratch.boxes[pair]);",
          "k-d tree: intervals leave the right child out", "tree trace"),
    Fault("src/trace/kd_walk.h", "{ray.origin.y, ray.inverse.y, ray.near_pad.y, ray.far_pad.y, ray.near_y != 0}",
          "{ray.origin.y, ray.inverse.y, ray.near_pad.y, ray.far_pad.y, ray.near_x != 0}",
          "k-d tree: rays take the ends of y in the order of x", "trace"),
    Fault("src/trace/kd_walk.h", "} while (at.entry > reach());", "} while (at.entry >= reach());",
          "k-d tree: a node that begins at the best t is skipped, so ties are lost", "trace"),
    Fault("src/trace/kd_outward.h", "if (far.bound() <= worst().d2) stack.push(far);",
          "if (far.bound() < worst().d2) stack.push(far);",
          "nearest neighbours: equal distances in the farther child are lost", "trace"),
    Fault("src/trace/kd_outward.h", "return first_id(tree, slot) < worst.point;", "return true;",
          "nearest neighbours: a query meets all equal points", "trace"),
    Fault("src/trace/kd_nearest.cpp", "(a.d2 == b.d2 && a.point < b.point)", "(a.d2 == b.d2 && a.point > b.point)",
          "nearest neighbours: ties go to the higher id", "trace"),
    Fault("src/engine/table_reader.h", "if (builds_trees && used_meshes_[stored.number])",
          "if (false && used_meshes_[stored.number])",
          "scenes of files in double: one mesh may stand in any number of geometries, each with a tree", "io"),
    Fault("src/image/surface_points.cpp", "const Double3 place = (Double3(ray.origin) - middle_) + direction * t;",
          "const Double3 place = Double3(ray.origin) + direction * t;",
          "secondary rays in double: points are rounded far from the origin", "image"),
    Fault("src/io/rdx_sections.cpp", "if (section.count > room / section.element_bytes)",
          "if (section.count * section.element_bytes > room)",
          ".rdx: a number of elements that wraps around is believed", "io"),
    Fault("src/tree/octree.h", "radix.point_count(radix.chain_above(slot))", "radix.point_count(radix.parent_slot(slot))",
          "octree: a node's parent is taken for its radix parent, chain or not", "tree"),
    Fault("src/tree/octree.h", ": radix.offsets[radix.chain_above(slot) + 1] - 1;",
          ": radix.offsets[radix.chain_above(slot)];", "octree: a chain hangs below the first node of the one above",
          "tree"),
    Fault("src/tree/octree_query.h", "inside = inside && first > box.lo[axis]", "inside = inside && first >= box.lo[axis]",
          "octree: points in the box's own border cells are taken without a look", "tree"),
    Fault("src/tree/octree_neighbour.cpp", "there.level == node.level || there.is_leaf() ?",
          "there.level <= node.level ?",
          "octree: a neighbour without points is the inner node around it", "tree"),
    Fault("src/tree/octree_query.cpp", "if (cell >> node.level != 0) return hi;\n", "",
          "octree: cubes at the upper border end beyond the root", "tree"),
    Fault("src/simt/simulated_warp.h", "count.lanes += static_cast<std::uint64_t>(std::popcount(active_));",
          "count.lanes += Width;", "simulated warp: idle lanes count as useful", "simt trace"),
    Fault("src/simt/schedule.h", "part.asked > slots_ ? slots_ / part.asked : 1.0;", "slots_ / part.asked;",
          "schedule: one warp may use all issue slots", "simt trace"),
    Fault("src/simt/schedule.h", "while (retired_ < next_ && done_[retired_]) ++retired_;", "++retired_;",
          "schedule: a block that is done frees the place of an earlier one", "simt trace"),
    Fault("src/simt/memory_replay.cpp", "if (way->used < oldest->used) oldest = way;", "",
          "caches: the first way is always the one that goes", "simt"),
    Fault("src/layout/woop48.h", "dot(z, v0)), x_fits", "-dot(z, v0)), x_fits", "woop48: planes on the wrong side", "trace"),
    Fault("src/layout/woop48.h", "cross(e2, n) * inverse, y", "cross(n, e2) * inverse, y", "woop48: u runs backwards", "trace"),
    Fault("src/trace/warp/steps.h", "const bool better = l.test_t < l.t || id < l.prim;", "const bool better = true;",
          "warp kernels: at equal t the last triangle wins", "trace"),
    Fault("src/trace/warp/steps.h", "l.test_u + l.test_v <= 1.0f;", "l.test_u + l.test_v <= 1.5f;",
          "warp kernels and their scalar reference: triangles reach beyond their third edge", "trace"),
    Fault("src/trace/warp/steps.h", "return l.test_t >= l.tmin && l.test_t <= l.t;", "return l.test_t <= l.t;",
          "warp kernels and their scalar reference: hits before the ray begins", "trace"),
    Fault("src/trace/warp/batches.h", "if (next >= job.launch.count) return false;",
          "if (next + Warp::width() >= job.launch.count) return false;",
          "persistent kernels: the last batch is left out", "trace"),
    Fault("src/trace/warp/per_ray.h", "l.node = any_hit && l.prim != no_primitive ? finished_node : next;",
          "l.node = l.prim != no_primitive ? finished_node : next;",
          "while-while and if-if: the first hit ends the ray", "trace"),
    Fault("src/trace/warp/work_queue.h", "l = spare;\n", "l = spare, l.top = 0;\n",
          "work queue: a ray that is exchanged loses its stack", "trace"),
    Fault("src/trace/warp/steps.h", "l.top -= empty ? 0 : 1;", "", "warp kernels: pop leaves its entry", "trace"),
    Fault("src/trace/warp/per_ray.h", "return at_leaf(l) && l.leaf == 0;", "return at_leaf(l);",
          "speculation: a second leaf takes the place of the first", "trace"),
    Fault("src/trace/warp/replacement.h", "count_ones(mask & lanes_below(lane))", "count_ones(mask >> lane)",
          "replacement: ranks count from the wrong end", "trace"),
    Fault("src/trace/warp/packet.h", "at.lanes &= alive;", "at.lanes = alive;", "packet: all lanes visit what one pushed", "trace"),
    Fault("src/trace/warp/simulate_launch.cpp", "if (--left[block] != 0) continue;",
          "if (left[block]-- == 0) continue;", "launch: a block's place is free with its first warp", "trace"),
    Fault("src/report/compare_section.cpp", "if (!a.error_known || !b.error_known) return Verdict::unknown;", "",
          "report: figures of unknown error are told apart", "report"),
    Fault("src/report/compare_rows.cpp", "2 * *error * std::fabs(*measure.value.median)", "0 * *error",
          "report: samples have no error", "report"),
    Fault("src/simt/memory_model.cpp", "together = request_bytes / word;", "together = request_bytes / 4;",
          "memory model: a whole warp asks for words of 16 bytes at once", "simt"),
    Fault("src/simt/memory_replay.cpp", "if (found.wrote_back) traffic.l2_bytes += machine_.l1_line_bytes;", "",
          "memory model: stacks are never written back", "simt"),
    Fault("src/simt/memory_replay.cpp", "while (part.free_places.empty()) take_turn(multiprocessor);",
          "while (!part.running.empty()) take_turn(multiprocessor);", "memory model: warps share no cache", "simt"),
    Fault("src/exec/parallel.cpp", "tbb::task_group_context::isolated", "tbb::task_group_context::bound",
          "loops: one that ends by an exception cuts short those inside of it", "exec"),
    Fault("src/layout/collapse_plan.h", "if (leaf_cost <= out.cost[0]) {", "if (leaf_cost <= 2 * out.cost[0]) {",
          "wide collapse: leaves that cost more than nodes", "layout"),
    Fault("src/layout/collapse_plan.h", "out.choose(static_cast<int>(i), apart <= together ? left(i) : 0);",
          "out.choose(static_cast<int>(i), left(i));",
          "wide collapse: a subtree is divided although it is cheaper whole", "layout"),
    Fault("src/layout/sorted_part_writer.h", "std::min(leaf_size(k), end - k)", "std::min(4u, end - k)",
          "straight wide trees: leaves of four, whatever the prefixes say", "layout"),
    Fault("src/layout/sorted_wide.cpp", "? groups_[g].first_block * block_lanes << 3", "? 0",
          "straight wide trees: leaves of the top lie in the first group", "layout"),
    Fault("src/layout/sorted_top.cpp", "return a.area < b.area;", "return a.area > b.area;",
          "straight wide trees: the smallest child is taken apart", "layout"),
    Fault("src/layout/quantise.cpp", "return value < x || (value == x && rest <= 0);", "return value <= x;",
          "cwbvh: what a double cannot hold of a difference is forgotten", "layout"),
    Fault("src/layout/quantise.cpp", "if (sum > best[set] || best[set]", "if (sum < best[set] || best[set]",
          "cwbvh: the worst slots are taken", "layout"),
    Fault("src/layout/cwbvh.cpp", "place_[child->first] = next++;", "place_[child->first] = child->first, ++next;",
          "cwbvh: child nodes do not follow the order of their slots", "layout trace"),
    Fault("src/trace/simd/single.h", "        top += count;", "        top += count - (count > 3 ? 1 : 0);",
          "rays in turn: the last of many children is forgotten", "trace engine"),
    Fault("src/trace/simd/single.h", "if (entry < at[k - 1]) return;", "if (k > 3) return;",
          "rays in turn: children are taken in another order than by single calls", "engine trace"),
    Fault("src/engine/scene_trace.cpp", "if (mesh->ids.size() == 1) return {found, mesh->ids.front(), 0};",
          "return {found, mesh->ids.front(), 0};", "single calls: all meshes are the first", "engine"),
    Fault("src/trace/simd/block_hits.h", "hn::Set(d, 0x1p-17f)", "hn::Set(d, 0x1p-40f)",
          "any hit: floats decide within their own error", "trace"),
    Fault("src/trace/cwbvh_walk.h", "ray.pad = cwbvh_pad_factor * slabs.near_pad;", "ray.pad = 0.0f * slabs.near_pad;",
          "cwbvh: boxes are not widened", "trace"),
    Fault("src/trace/cwbvh_walk.h", "triangle.prim < best.prim)", "triangle.prim > best.prim)",
          "cwbvh: ties go to the higher id", "trace"),
    Fault("src/engine/hit_order.h", "std::tuple(hit.t, hit.instance, hit.geometry, hit.prim)",
          "std::tuple(hit.t, hit.geometry, hit.instance, hit.prim)", "scenes: ties go to the least geometry, then the instance",
          "engine"),
    Fault("src/engine/extent.h", "0x1p-18};\n}", "0x1p-50};\n}", "scenes: boxes of meshes do not widen with distance", "engine"),
    Fault("src/engine/extent.h", "errors.condition * inner.error + errors.rounding};", "inner.error};",
          "scenes: maps do not make errors larger", "engine"),
    Fault("src/engine/part_tree.cpp", "for (std::uint32_t& part : out.part) part = parts[part];", "",
          "scenes: parts of the second tree are taken for those of the first", "engine"),
    Fault("src/engine/part_tree.cpp", "if (!(cost <= limit * old.cost_at_build)) return false;", "",
          "scenes: the tree over parts is refitted whatever it costs", "engine"),
    Fault("src/layout/wide_refit.cpp", "            fit(center_of(bounds));\n", "",
          "refit: planes are about the middle of vertices that no triangle has", "layout engine"),
    Fault("src/layout/wide_refit.cpp", "waits_[word] != 0 || word / nodes_of_a_run", "word / nodes_of_a_run",
          "refit: a node is fitted before one that waits for another run", "layout"),
    Fault("src/layout/wide_refit.cpp", "for_each_range(first.front(), 256,", "for_each_range(0, 256,",
          "refit: blocks of two runs stay as they were", "layout"),
    Fault("src/layout/wide_refit.cpp", "const unsigned unsure = used & ~(checks_range_ ? 0u : surely_large(a, b, c));",
          "const unsigned unsure = used & ~surely_large(a, b, c);", "refit: triangles out of range stay", "layout engine"),
    Fault("src/engine/commit.cpp", "out.refitter = nullptr;  // a refit that was tried had other links", "",
          "scenes: a tree is refitted by the links of the one before it", "engine"),
    Fault("src/engine/scene.cpp", "if (!same_triangles || mesh.vertices.size() < geometry.mesh.vertices.size())",
          "if (!same_triangles)", "scenes: vertices that are gone are not missed", "engine"),
    Fault("src/exec/recycler.h", "[recycler = *this](T* used)", "[recycler = Recycler()](T* used)",
          "memory that nobody holds any more serves nothing", "exec layout"),
    Fault("src/exec/path_rates.h", "void share(const PathRates& other) { known_ = other.known_; }",
          "void share(const PathRates&) {}", "rates: a new frame knows nothing of the last one", "trace"),
    Fault("src/engine/part_tree.cpp", "return wide_leaf_bit | child.first << 3 | (child.count - 1);",
          "return wide_leaf_bit | child.first << 3;", "scenes: only the first part of a leaf is seen", "engine"),
    Fault("src/engine/commit.cpp", "part.number = whole.number + below.number;", "part.number = below.number;",
          "scenes: paths of opened instances count from the inner scene's own", "engine"),
    Fault("src/engine/shape_commit.h", "if (same_way && !geometry.changed && old->mask == geometry.mask) return old;",
          "if (same_way && !geometry.changed) return old;", "scenes: a new mask of shapes is not seen", "engine"),
    Fault("src/engine/commit.cpp", "tree_->ways.push_back(inner.ways[below.first + w]);",
          "tree_->ways.push_back(inner.ways[below.first]);", "scenes: the third level of instances stands where the second does",
          "engine"),
    Fault("src/engine/grouped_meshes.h", "std::upper_bound(first.begin(), first.end(), prim) - first.begin() - 1));",
          "std::lower_bound(first.begin(), first.end(), prim) - first.begin()));", "scenes: triangles belong to the next mesh",
          "engine"),
    Fault("src/engine/flat_scene.cpp", "turned != (way != no_way && ways[way].mirrors)", "turned",
          "bodies: a mirror in a mirror is still one", "engine"),
    Fault("src/engine/scene_ray.h", "if (best.hit() && !(order_of(found) < order_of(best))) return false;", "",
          "scenes: ties go to what was found last", "engine"),
    Fault("src/engine/scene_walk.h", "if ((mask & job_.limits[level.sources[ray].id].mask) != 0) level.seen.push_back(ray);",
          "level.seen.push_back(ray);", "scenes: masks of rays are forgotten in lists", "engine"),
    Fault("src/engine/shape_leaves.h", "hn::MulAdd(far, hn::Set(f8, 0x1p-19f), radius)", "hn::MulAdd(far, hn::Set(f8, 0x1p-60f), radius)",
          "spheres: floats leave some out within their own error", "engine"),
    Fault("src/engine/shape_leaves.h", "ray.tmax = scale == 1.0 ? t :", "ray.tmax = true ? t :",
          "shapes: rays of other lengths end where they should not", "engine"),
    Fault("src/engine/near_walk.h", "all[stack.top++] = b_first ? a : b;", "all[stack.top++] = b_first ? b : a;",
          "distance: one child twice, the other not at all", "engine"),
    Fault("src/engine/near_probes.h", "if (!(other.d2 < best_.d2) && !(other.name() < best_.name())) return;",
          "if (!(other.d2 < best_.d2)) return;", "distance: ties stay with what was found first", "engine"),
    Fault("src/engine/near_probes.h", "turned ? p.v[lane] : p.u[lane],", "p.u[lane],", "distance: u of mirrored instances", "engine"),
    Fault("src/engine/near_probes.h", "return {at, 2 * length(off) + 0x1p-44 * far + 0x1p-22 * way.size};", "return {at, 0};",
          "distance: places in instances are taken for exact", "engine"),
    Fault("src/engine/triangle_leaves_double.h", "hn::And(hn::Ge(t, tmin), hn::Le(t, tmax))", "hn::And(hn::Gt(t, tmin), hn::Le(t, tmax))",
          "doubles: a hit at tmin is none", "engine trace"),
    Fault("src/engine/box_frame_double.h", "hn::Mul(hn::Abs(start), hn::Set(f4, 0x1p-21f))", "hn::Mul(hn::Abs(start), hn::Set(f4, 0x1p-60f))", "doubles: boxes are not widened", "engine trace"),
    Fault("src/points/nearest.h", "d2 < d2_[at] || (d2 == d2_[at] && id < ids_[at])", "d2 <= d2_[at]",
          "nearest points: ties go to the last", "points"),
    Fault("src/points/nearest.h", "hn::IfThenElse(first_, hn::Zero(d), rotated)", "rotated",
          "nearest points: the first key has the last one for a neighbour", "points"),
    Fault("src/points/point_forest.cpp", "if (ids != nullptr) id = ids[id];", ";",
          "points that come have their numbers in their own tree", "points"),
    Fault("src/points/point_forest.cpp", "--arrays_.nodes[node].points[child - arrays_.nodes[node].below];", ";",
          "points that go are still counted where a radius holds all of a subtree", "points"),
    Fault("src/points/point_forest.cpp", "else if (at_bounds)", "else if (false)",
          "points that go: the index's box stays as it was", "points"),
    Fault("src/exec/job_loop.cpp", "if (inside_job) return 1;", ";",
          "a loop inside a job of the caller's pool asks the pool for more threads", "exec"),
    Fault("src/points/range_query.h", "hn::Le(hn::Load(Lanes<T>(), node.hi[d] + from), hi_.at[d])",
          "hn::Le(hn::Load(Lanes<T>(), node.lo[d] + from), hi_.at[d])", "points in a box: boxes that reach out are taken whole", "points"),
    Fault("src/base/heap_row.h", "return d2 > other_d2 || (d2 == other_d2 && id > other_id);", "return d2 > other_d2;",
          "nearest points, many: ids do not count", "points"),
    Fault("src/proximity/closest_on_triangle.h", "s = swapped ? 1.0 - t : t;", "s = t;", "closest points: weights of turned edges", "proximity"),
    Fault("src/proximity/crossings.h", "const bool upward = to.z > p.z;", "const bool upward = to.z >= p.z;",
          "inside: edges that end at the point's height count twice", "proximity"),
    Fault("src/proximity/pair_walk.h", "bits(_mm_cmpeq_epi32(_mm_shuffle_epi32(x, 0xAA), y)) << 8", "bits(_mm_cmpeq_epi32(_mm_shuffle_epi32(x, 0xAA), y)) << 4",
          "pairs: the third corner is taken for the second", "proximity"),
    Fault("src/proximity/sweep_walk.h", "(t == best.t && t < infinity && tree.order[k] < best.prim)", "(t == best.t && false)",
          "sweeps: ties stay with what was found first", "proximity"),
    Fault("src/proximity/winding_tree.cpp", "if (sum.area > 0) return sum.place * (1.0 / sum.area);", "if (sum.area > 0) return sum.place;",
          "winding numbers: centers of mass are sums", "proximity"),
    Fault("src/engine/affine.h", "Double3(yz.y, zx.y, xy.y) * s,", "Double3(yz.y, zx.y, xy.y),", "instances: a row of the inverse is not divided",
          "engine instances"),
    Fault("src/engine/affine.h", "std::fabs(det) > 0x1p-40 * size", "std::fabs(det) > 0.0 * size", "instances: flat maps are let in", "engine instances"),
    Fault("src/exec/thread_own.h", "if (!kept.taken) {", "if (!kept.taken || true) {",
          "calls from within calls share one memory", "engine"),
    Fault("src/exec/scan.h", "scan_row<Probe>(values.subspan(begin, end - begin), sums[b]);", "scan_row<Probe>(values.subspan(begin, end - begin), T{0});",
          "scan: blocks begin at zero", "exec tree"),
    Fault("src/exec/result_budget.cpp", "    held_.fetch_sub(bytes, std::memory_order_relaxed);\n    return false;", "    return false;",
          "limits: what was refused stays counted", "exec limits"),
    Fault("src/exec/join_copies.h", "const bool mirrors = copy.mirrors();", "const bool mirrors = copy.mirrors() && false;",
          "flattened meshes: mirrored copies are inside out", "engine instances"),
    Fault("src/rays/ray_order.cpp", "for (int level = 13; level >= 4; --level)", "for (int level = 13; level >= 5; --level)",
          "sorted rays: a level of the key is left out", "rays"),
    Fault("src/rays/sampling.h", "mirrored = mirrored * base + index % base;", "mirrored = mirrored * base + index % 2;",
          "ambient occlusion: digits of the second base", "rays"),
    Fault("src/scene/ply_binary.cpp", "if (swapped) std::reverse(raw.begin(), raw.end());", "if (!swapped) std::reverse(raw.begin(), raw.end());",
          "PLY: bytes in the wrong order", "scene"),
    Fault("src/report/plot_axis.cpp", "(std::log(value) - std::log(lo)) / (std::log(hi) - std::log(lo))",
          "std::log(value) / (std::log(hi) - std::log(lo))", "plots: logarithmic places begin at one", "report"),
    Fault("src/mpi/rank_tree.h", "if (far.bound <= most) *top++ = far;", "if (far.bound < most) *top++ = far;",
          "ranks: one that is just as far as the best is not asked, though it may hold a lower number", "mpi"),
    Fault("src/mpi/point_queries.h", "merged_.d2[old] == at && merged_.ids[old] < id", "merged_.d2[old] == at && merged_.ids[old] > id",
          "ranks: of points that are equally near the higher number comes first", "mpi"),
    Fault("src/mpi/rounds.h", "again_.push_back({queries[k], static_cast<std::uint32_t>(rank)});", "static_cast<void>(rank);",
          "ranks: a question that was not answered in its round is forgotten", "mpi"),
    Fault("src/mpi/distributed_points.cpp", "return a.id < b.id; });", "return a.id > b.id; });",
          "ranks: points that moved along the curve do not lie in the order of their numbers", "mpi"),
    Fault("src/mpi/ray_reach.h", "if (std::signbit(inverse_[d])) std::swap(near, far);", "",
          "ranks: rays that go down an axis reach no box", "mpi"),
    Fault("src/mpi/inside_query.h", "((bits | more) & 2u)", "((bits | more) & 0u)",
          "ranks: a point on a triangle is inside or outside by chance", "mpi"),
]


def run(arguments, limit=None, **options):
    """Exit code of a command, None if it ran out of time. Its output is kept in build/mutate/last.log."""
    with open(WORK / "last.log", "wb") as log:
        process = subprocess.Popen(arguments, stdout=log, stderr=subprocess.STDOUT, start_new_session=True, **options)
        try:
            return process.wait(limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            process.wait()
            return None


def last_lines(count=15):
    return "\n".join((WORK / "last.log").read_text(errors="replace").splitlines()[-count:])


def copy_tree():
    """Brings the copy up to date; files that did not change keep their time, so that little is built again."""
    listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT, check=True,
                            stdout=subprocess.PIPE).stdout.decode().split("\0")
    names = {name for name in listed if name and (ROOT / name).is_file()}
    for old in [f for f in SOURCE.rglob("*") if f.is_file()]:
        if old.relative_to(SOURCE).as_posix() not in names:
            old.unlink()
    for name in names:
        source, target = ROOT / name, SOURCE / name
        if not target.exists() or target.read_bytes() != source.read_bytes():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


def test_programs():
    """Folder of tests/ -> its program."""
    folders = [f.name for f in sorted((SOURCE / "tests").iterdir()) if list(f.glob("*_test.cpp"))]
    programs = {folder: BUILD / "bin" / f"{folder}_test" for folder in folders}
    if shutil.which(MPIRUN[0]):
        programs["mpi"] = BUILD / "bin" / "mpi_ranks"
    return programs


def build(targets):
    return run(["cmake", "--build", str(BUILD), "--parallel", JOBS, "--target", *targets]) == 0


def looks_of(folders):
    """The looks that test programs take at a fault, as (folder, filter of its tests): at first without those of LONG."""
    long = [(folder, ":".join(LONG[folder])) for folder in folders if folder in LONG]
    return [(folder, "-" + dict(long).get(folder, "")) for folder in folders], long


def run_program(program, tests, limit):
    launcher = MPIRUN if program.name == "mpi_ranks" else []
    code = run([*launcher, str(program), "--gtest_brief=1", "--gtest_fail_fast=1", f"--gtest_filter={tests}"], limit, cwd=WORK)
    return {0: None, None: "time"}.get(code, "test")


def prepare(faults):
    """Builds, without a fault, the programs that look at the faults first."""
    WORK.mkdir(parents=True, exist_ok=True)
    lock = open(WORK / "lock", "w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        sys.exit("another run is at work in build/mutate")
    SOURCE.mkdir(exist_ok=True)
    copy_tree()
    # Faults change answers, not speed: what compiles sooner will do. At -O1, GCC 12 warns of what is not so.
    configured = run(["cmake", "-G", "Ninja", "-S", str(SOURCE), "-B", str(BUILD), "-DCMAKE_BUILD_TYPE=Release",
                      "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -w -DNDEBUG", "-DRAYDIX_INSTRUCTION_SETS=ONE", "-DRAYDIX_BENCH=OFF",
                      "-DRAYDIX_CLI=OFF", "-DRAYDIX_ATTACK=OFF", "-DRAYDIX_CUDA=OFF"]) == 0
    programs = test_programs()
    first = {folder for fault in faults for folder in fault.tests.split()}
    if not configured or not build([program.name for folder, program in programs.items() if folder in first]):
        sys.exit(f"without any fault, the tests do not build:\n{last_lines()}")
    return programs, lock


def set_limits(looks, programs, limits):
    """Without a fault every look must pass, and its time sets its limit. Each is taken once, when it is first needed."""
    for folder, tests in looks:
        if (folder, tests) in limits:
            continue
        start = time.monotonic()
        if not build([programs[folder].name]) or run_program(programs[folder], tests, None) is not None:
            sys.exit(f"without any fault, {programs[folder].name} fails:\n{last_lines()}")
        limits[folder, tests] = LEAST_TIME_LIMIT_S + 5 * (time.monotonic() - start)


def noticed_in(looks, programs, limits):
    """Which of these looks notices what is planted, or None."""
    if looks and not build([programs[folder].name for folder, _ in looks]):
        return "the compiler"
    for folder, tests in looks:
        reason = run_program(programs[folder], tests, limits[folder, tests])
        if reason:
            return f"{folder}_test" + (" (time)" if reason == "time" else "")
    return None


def noticed_by(fault, programs, limits):
    """Plants the fault; what noticed it, or None."""
    first = [folder for folder in fault.tests.split() if folder in programs]
    file = SOURCE / fault.file
    text = file.read_text()
    for looks in (*looks_of(first), *looks_of([f for f in programs if f not in first])):
        set_limits(looks, programs, limits)
        file.write_text(text.replace(fault.old, fault.new))
        try:
            who = noticed_in(looks, programs, limits)
        finally:
            file.write_text(text)
        if who:
            return who
    return None


def known_results():
    """What earlier runs gave: those that are committed, and later ones here."""
    known = {}
    if COMMITTED.is_file():
        for row in json.loads(COMMITTED.read_text(encoding="utf-8"))["rows"]:
            if "fault" in row:
                known[row["fault"]] = {"noticed_by": row["noticed_by"], "commit": row["commit"]}
    if RESULTS.is_file():
        known |= json.loads(RESULTS.read_text(encoding="utf-8"))
    return known


def name_of(fault):
    """By the fault's own text, so that a fault that changed is not taken for the one that ran."""
    return f"{fault.file}: {fault.old} -> {fault.new}"


def keep_result(fault, noticed):
    results = known_results()
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True).stdout
    results[name_of(fault)] = {"noticed_by": noticed, "commit": commit.strip()}
    RESULTS.write_text(json.dumps(results, indent=1), encoding="utf-8")


def commit_results():
    results = known_results()
    rows = [{"file": fault.file, "breaks": fault.breaks, "fault": name_of(fault), **results[name_of(fault)]}
            for fault in FAULTS if name_of(fault) in results]
    missing = [fault.breaks for fault in FAULTS if name_of(fault) not in results]
    summary = {"faults": len(FAULTS), "run": len(rows), "noticed": sum(row["noticed_by"] is not None for row in rows),
               "never_run": missing, "rows": rows}
    COMMITTED.write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    print(f"wrote {COMMITTED.relative_to(ROOT)}: {summary['noticed']} noticed of {len(rows)} that ran, of {len(FAULTS)} faults")


def main(arguments):
    if arguments == ["--commit-results"]:
        return commit_results()
    chosen = [int(a) for a in arguments] or list(range(1, len(FAULTS) + 1))
    programs, _lock = prepare([FAULTS[number - 1] for number in chosen])  # the lock lasts as long as the run
    limits = {}
    bad = []
    for number in chosen:
        fault = FAULTS[number - 1]
        file = SOURCE / fault.file
        times = (file.read_text() if file.is_file() else "").count(fault.old)
        start = time.monotonic()
        if times != 1:
            outcome = f"DOES NOT APPLY: the old text stands {times} times in the file"
            bad.append(number)
        else:
            who = noticed_by(fault, programs, limits)
            keep_result(fault, who)
            outcome = f"noticed by {who}" if who else "NOT NOTICED"
            bad += [] if who else [number]
        print(f"{number:3}  {fault.file}: {fault.breaks}\n     {outcome} ({time.monotonic() - start:.0f} s)", flush=True)
    print(f"{len(chosen) - len(bad)} of {len(chosen)} faults noticed" + (f"; not: {bad}" if bad else ""))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
